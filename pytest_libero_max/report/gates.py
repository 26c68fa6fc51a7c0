"""Gates: one-line conditions on a report, for example ``event.camera_shift.delta.lower >= -0.15``.

The language::

    gate      = quantity operator number
    operator  = ">=" | "<=" | ">" | "<" | "==" | "!="
    number    = a decimal number, or a percentage such as 60% (exactly 0.6)
    quantity  = [scope "."] name ["." end]   a rate, a change, a count or a summary of the run
              | section ["." end]            a number of a section, for example timing.mean.change
              | [scope "."] probe "." column ["." arm] [".largest"]   a column of a probe, by default in
                                             Dynamic: its mean over the pairs, or the largest value of one
              | name "(" run options ")" ["." end]   the same cases now and in another run, by its folder
    gate      = "equivalent_vs(" run "," number options ")"   Dynamic success differs by less than the number
    gate      = ("base" | "dynamic") "_sr_vs_published(" row "," number ")"   the same for a row of the paper
    options   = { ", allow=" setting {"+" setting} | ", first=pass" }
    scope     = dimension "." group          for example event.camera_shift, category.pro-position
    end       = "lower" | "upper"            of the 95% interval

Every quantity has a scale: the values it can have. A gate that no value or every value of the scale meets is
refused, because it would test nothing. Numbers are compared exactly, as decimals of the report.

``equivalent_vs`` holds where the 90% interval of the difference lies inside the margin on both sides, which
are two one-sided tests at 5% (D. J. Schuirmann (1987), J. Pharmacokinet. Biopharm. 15:657-680).

``base_sr_vs_published(pi05, 5%)`` holds where the 90% interval of Base success less that of the paper's row
``pi05`` lies inside the margin: then the run is connected with the published number. The interval takes the
runs as independent, and is wider than it need be, because they played the same cases. It asks for all of the
authors' 8,000 cases, of their 2,400 of LIBERO-PRO or of their 800 of Lite, on genuine scenes, as published,
and for the Q of the row; anything else is refused with the reason. ``libero-max list published`` names rows.

A gate against another run is undecidable where the runs differ in a setting beside the policy, for example
the strength of events, the latency, H and Q, a wrapper such as ``restore=gated``, the semantics, a version or
the renderer: everything of which ``libero-max compare`` warns. It says which. ``allow=strength`` accepts a
setting by name, ``allow=strength+versions`` several, and the verdict repeats what was accepted.

``first=pass`` is for the first run of a series, as in continuous integration: the gate passes as long as its
folder of the other run is missing or empty, and says so. This run must then be fit to be the other one next
time: complete, with Base successes and events enough, and such that the gate can fail against it.

The gates of a shard are decided on all shards together, by ``libero-max shards merge``.

A gate that every outcome of its pairs meets, or none, is refused before anything is played, and so is one
against a run that leaves nothing to decide, for example ``regressions_vs(RUN) <= 0`` where Dynamic never
succeeded there.

A gate over pairs of which some are missing or invalid, or whose denominator is zero, is undecidable. So is
one on what the event changed, or against another run, where Base succeeds in less than 20% of the pairs, or
the event happened in less than 50%: it would pass because nothing was there to be lost. Gate ``base_sr`` and
``trigger_coverage`` as well. An undecidable gate is not passed, and its reason is said.
A gate that a stopping rule has decided is an exception: the run has the verdict of its rule (``certain``,
``anytime``), for whatever the pairs that are not played would have shown.

The page and ``report.md`` show each gate of the run with its value and one of five verdicts: *holds*,
*violated*, *not shown*, *open* (undecidable) or *no baseline yet*. A gate on an end of an interval is
violated if the other end does not meet it either; otherwise it is not shown, and the line says
with how many pairs four of five runs would show it. A failed ``equivalent_vs``, or a failed gate against a
row of the paper, is violated if all of its interval lies beyond the margin. ``libero-max report`` decides the
gates again that it is given, or those of the ini file.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal

from pytest_libero_max.benchmark.tracks import all_track_names, load_track
from pytest_libero_max.errors import OptionError, counted, did_you_mean
from pytest_libero_max.events.registry import EVENTS, families
from pytest_libero_max.report.connection import ARMS, connect, published_row
from pytest_libero_max.report.formats import (
    COUNT,
    DIFFERENCE,
    NUMBER,
    P_VALUE,
    SHARE,
    Scale,
    lack_of_tasks,
    tenths,
)
from pytest_libero_max.report.gate_arguments import RunArguments, read_arguments, refused
from pytest_libero_max.report.gate_quantities import (
    COUNTS,
    GATED,
    OTHER_NAMES,
    WHOLE_TRACK,
    probe_column,
    row_quantity,
    section_of,
    section_quantities,
    section_value,
)
from pytest_libero_max.report.groups import DIMENSIONS
from pytest_libero_max.report.measurable import lack_of_run, lacks_of
from pytest_libero_max.report.measures import UNITS
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.blocks import SuccessContrast, SuccessDifference, TaskInterval

if TYPE_CHECKING:
    from pytest_libero_max.stats.intervals import Interval

Verdict = Literal["passed", "failed", "undecidable"]

Finding = Literal["holds", "violated", "not shown", "open", "no baseline yet"]
"""A verdict in the words of reports, which tell the two ways apart in which the end of an interval fails."""

OPERATORS: Mapping[str, Callable[[Fraction, Fraction], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
    "==": operator.eq,
    "!=": operator.ne,
}

VERSUS: Mapping[str, tuple[Callable[[SuccessContrast], SuccessDifference | float | None], Scale]] = {
    "regressions_vs": (lambda contrast: contrast.first_only, COUNT),
    "gains_vs": (lambda contrast: contrast.second_only, COUNT),
    "dynamic_sr_vs": (lambda contrast: contrast.difference, DIFFERENCE),
    "p_value_vs": (lambda contrast: contrast.p_value, P_VALUE),
}
"""Quantities against another run, whose Dynamic outcomes come first in the contrast, with their scales."""

SUCCESS_OF = {"base_sr": "base_success", "dynamic_sr": "dynamic_success"}
"""Attribute of a record by the rate that is its mean; pairs where it is false count against the rate."""

EQUIVALENT = "equivalent_vs"
"""Largest end, without its sign, of the 90% interval of Dynamic success less that of another run."""

EQUIVALENCE_CONFIDENCE = 0.9

_FLAG = Scale("0 or 1", 0, 1, whole=True, percent=False)

_GATE = re.compile(r"(?P<quantity>.+?)\s*(?P<operator>>=|<=|==|!=|>|<)\s*(?P<number>\S+)")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?%?")
_EXPONENT = re.compile(r"[eE][+-]?0*(\d+)")
_MOST_EXPONENT_DIGITS = 3
"""A number with a larger exponent would fill the memory when it is written out."""
_MARGIN = re.compile(rf"(?P<name>{'|'.join((EQUIVALENT, *ARMS))})\((?P<arguments>[^()]+)\)")
_CALL = re.compile(r"(?P<name>\w+)\((?P<arguments>[^()]+)\)(\.(?P<end>\w+))?")


@dataclass(frozen=True)
class Gate:
    """A condition a report has to meet."""

    text: str
    name: str
    """The quantity, without scope and end."""
    scope: tuple[str, str] | None
    """Dimension and group, or None for the whole run."""
    end: str | None
    """``lower`` or ``upper`` end of the interval, or None for the estimate."""
    run: str | None
    """Folder of the other run, for a quantity against another run."""
    operator: str
    threshold: Fraction
    """Number that the quantity is compared with, exactly as written."""
    percent: bool = False
    allow: tuple[str, ...] = ()
    """Names of settings in which the other run may differ."""
    first: bool = False
    """True if the gate passes as long as there is no other run."""
    row: str | None = None
    """Key of the row of the paper, for a quantity against one."""

    def of_scope(self, pairs: Iterable[PlannedPair]) -> list[PlannedPair]:
        """Return the pairs that it is on."""
        if self.scope is None:
            return [*pairs]
        dimension, group = self.scope
        return [pair for pair in pairs if DIMENSIONS[dimension].label(pair) == group]


@dataclass(frozen=True)
class GateResult:
    """Verdict on a gate."""

    gate: Gate
    verdict: Verdict
    value: float | None
    """The quantity's value; None where it is undecidable."""
    detail: str
    """What explains the verdict, in the unit of the gate's number."""
    lost: tuple[str, ...] = ()
    """Item ids of the pairs that count against a gate that failed: those that Base completes and Dynamic does
    not, or that another run completes and this one does not."""
    not_shown: bool = False
    """True for a gate on an end of an interval that failed, and whose other end meets it."""
    differences: str = ""
    """Sentences on the settings in which the other run differs and which the gate allows, and on what differs
    between policies of one name; empty for none."""
    no_baseline: bool = False
    waits: bool = False
    """True for a gate of a shard, which is decided on all shards together."""

    @property
    def reason(self) -> str:
        """The gate, its verdict and what explains it, as one text."""
        return f"{self.gate.text}: {self.verdict}, {self.detail} {self.differences}".rstrip()

    @property
    def finding(self) -> Finding:
        if self.no_baseline:
            return "no baseline yet"
        if self.verdict == "failed":
            return "not shown" if self.not_shown else "violated"
        return "holds" if self.passed else "open"

    @property
    def passed(self) -> bool:
        return self.verdict == "passed"


def parse_gate(text: str) -> Gate:
    """Read a gate.

    Raises:
        OptionError: It is not in the language; says what is, and the closest known name.
    """
    margin = _MARGIN.fullmatch(text.strip())
    if margin is None:
        gate = _comparison(text.strip())
    else:
        gate = _within_margin(margin["name"], margin.string, margin["arguments"])
    _require_open(gate)
    return gate


def _comparison(text: str) -> Gate:
    """Read ``QUANTITY OPERATOR NUMBER``."""
    match = _GATE.fullmatch(text)
    if match is None:
        raise refused(
            text,
            f" is not a condition. Write QUANTITY OPERATOR NUMBER, for example "
            f"'dynamic_sr >= 0.6', or '{EQUIVALENT}(RUN, 5%)'; operators: {' '.join(OPERATORS)}.",
        )
    threshold, percent = _number(match["number"], text), match["number"].endswith("%")
    quantity = match["quantity"].strip()
    call = _CALL.fullmatch(quantity)
    if call is not None:
        name, end, arguments = _versus_quantity(call["name"], call["end"], call["arguments"], text)
        return Gate(
            text,
            name,
            None,
            end,
            arguments.run,
            match["operator"],
            threshold,
            percent,
            arguments.allow,
            arguments.first,
        )
    name, scope, end = _parse_quantity(quantity, text)
    return Gate(text, name, scope, end, None, match["operator"], threshold, percent)


def _within_margin(name: str, text: str, arguments: str) -> Gate:
    """Read ``equivalent_vs(RUN, MARGIN)`` or ``base_sr_vs_published(ROW, MARGIN)``."""
    other, margin, allow, first = read_arguments(arguments, text)
    of_row = name in ARMS
    if margin is None:
        raise refused(text, f" has no margin. Write '{name}({'pi05' if of_row else 'RUN'}, 5%)'.")
    percent, number = margin.endswith("%"), _number(margin, text)
    if not of_row:
        return Gate(text, name, None, None, other, "<", number, percent, allow, first)
    if allow or first:
        raise refused(text, f" has {'allow' if allow else 'first'}, which is for gates against another run.")
    try:
        published_row(other)
    except OptionError as error:
        raise refused(text, f": {error}") from None
    return Gate(text, name, None, None, None, "<", number, percent, row=other)


def _number(number: str, text: str) -> Fraction:
    if not _NUMBER.fullmatch(number):
        raise refused(text, f" compares with {number!r}, but must compare with a number or a percentage.")
    exponent = _EXPONENT.search(number)
    if exponent is not None and len(exponent[1]) > _MOST_EXPONENT_DIGITS:
        raise refused(text, f" compares with {number!r}, but no quantity is so large or so small.")
    return Fraction(number.rstrip("%")) / (100 if number.endswith("%") else 1)


def scale_of(name: str) -> Scale:
    """Return the values that a quantity can have."""
    if name in VERSUS:
        return VERSUS[name][1]
    if name in (EQUIVALENT, *ARMS):
        return SHARE
    if name == WHOLE_TRACK:
        return _FLAG
    if (place := section_of(name)) is not None:
        return UNITS[place[1].unit].scale
    if name not in (*COUNTS, *GATED):
        return NUMBER
    return COUNT if name in COUNTS else GATED[name].format.scale


def _require_open(gate: Gate) -> None:
    scale = scale_of(gate.name)
    if gate.percent and not scale.percent:
        raise refused(
            gate.text, f" compares {gate.name} with a percentage, but it is {scale.name}. Give a number."
        )
    always, never = always_or_never(gate, scale.least, scale.most, whole=scale.whole)
    if always or never:
        raise refused(
            gate.text,
            f" can never {'fail' if always else 'hold'}: {gate.name} is {scale.name}. {_share_meant(gate)}",
        )


def always_or_never(
    gate: Gate, least: float | None, most: float | None, *, whole: bool = False
) -> tuple[bool, bool]:
    """Return whether every value of a range meets a gate, and whether none does.

    Args:
        least: Smallest value; None where there is none, as for ``most``.
        most: Largest value.
        whole: True if all values are whole numbers.
    """
    number = gate.threshold
    low, high = (None if end is None else Fraction(repr(end)) for end in (least, most))
    below, above = low is not None and number < low, high is not None and number > high
    first, last = low is not None and number <= low, high is not None and number >= high
    outside = below or above or (whole and number.denominator != 1)
    return {
        ">=": (first, above),
        ">": (below, last),
        "<=": (last, below),
        "<": (above, first),
        "==": (first and last, outside),
        "!=": (outside, first and last),
    }[gate.operator]


def _share_meant(gate: Gate) -> str:
    """Return the cure of a number that decides nothing: a share, where it was meant as a percentage."""
    scale, share = scale_of(gate.name), gate.threshold / 100
    inside = scale.least is not None and share > scale.least and (scale.most is None or share < scale.most)
    if scale.percent and not gate.percent and share != 0 and inside:
        return f"Write {float(gate.threshold):.12g}% or {float(share):.12g}."
    return "Give a number that decides something."


def parse_gates(texts: Iterable[str]) -> tuple[Gate, ...]:
    """Read gates as an ini file or repeated options give them, without empty lines and ``#`` comments."""
    lines = (line.partition("#")[0].strip() for text in texts for line in text.splitlines())
    return tuple(parse_gate(line) for line in lines if line)


def evaluate_gate(
    gate: Gate, report: Report, contrasts: Mapping[str, SuccessContrast | str] | None = None
) -> GateResult:
    """Decide a gate. Pure: reads nothing but its arguments and the frozen tracks.

    Args:
        gate: Result of :func:`parse_gate`.
        report: Result of :func:`~pytest_libero_max.report.build.build_report`.
        contrasts: For each ``run`` that gates name, the contrast of Dynamic success with that run first and
            this one second, as in ``compare_runs(...).contrasts``; or why there is none.
    """
    if gate.run is not None:
        value, lack = _versus(gate, report, contrasts or {})
    elif gate.row is not None:
        connection = connect(report, gate.row, ARMS[gate.name])
        value, lack = (None, connection) if isinstance(connection, str) else (connection.largest, "")
    elif gate.name in COUNTS and gate.scope is None:
        value, lack = getattr(report.pairs, gate.name), ""
    elif gate.name == WHOLE_TRACK:
        value, lack = _whole_track(report)
    elif section_of(gate.name) is not None:
        value, lack = section_value(gate.name, gate.end, report)
    else:
        value, lack = _in_block(gate, report)
    if value is None:
        return GateResult(gate, "undecidable", None, f"{lack.rstrip('.')}.")
    passed = meets(gate, value)
    verdict: Verdict = "passed" if passed else "failed"
    what = "the 90% interval reaches" if gate.name in (EQUIVALENT, *ARMS) else "it is"
    return GateResult(gate, verdict, value, f"{what} {shown(gate, value)}.")


def meets(gate: Gate, value: float) -> bool:
    """Tell whether the quantity of a gate may have this value."""
    return OPERATORS[gate.operator](Fraction(repr(value)), gate.threshold)


def shown(gate: Gate, value: float) -> str:
    """Return the value in the unit of the gate, with as many decimals as show on which side it lies."""
    if not gate.percent:
        return f"{value:.12g}"
    for decimals in range(1, 10):
        text = tenths(value, decimals=decimals)
        if _side(Fraction(text) / 100, gate) == _side(Fraction(repr(value)), gate):
            break
    return f"{text}%"


def _side(value: Fraction, gate: Gate) -> tuple[bool, bool]:
    return value < gate.threshold, value > gate.threshold


def _versus_quantity(
    name: str, end: str | None, arguments: str, text: str
) -> tuple[str, str | None, RunArguments]:
    """Read ``NAME(RUN, ...).END``."""
    if name in (EQUIVALENT, *ARMS):
        other = "pi05" if name in ARMS else "RUN"
        raise refused(text, f" compares {name}, which is a condition. Write '{name}({other}, 5%)'.")
    if name not in VERSUS:
        raise refused(
            text, f" has the unknown quantity {name!r}. {did_you_mean(name, [*VERSUS, EQUIVALENT, *ARMS])}"
        )
    if end is not None and name != "dynamic_sr_vs":
        raise refused(text, f" asks for {end!r} of {name}, which has no interval.")
    read = read_arguments(arguments, text)
    if read.margin is not None:
        raise refused(text, f" has the unknown argument {read.margin!r}. Write '{name}(RUN)', with a folder.")
    return name, _end(end, text), read


def _parse_quantity(quantity: str, text: str) -> tuple[str, tuple[str, str] | None, str | None]:
    parts = quantity.split(".")
    scope: tuple[str, str] | None = None
    if parts[0] in DIMENSIONS:
        if len(parts) < 3:
            raise refused(
                text,
                f" names a dimension without group and quantity; write for example "
                f"'{parts[0]}.GROUP.dynamic_sr >= 0.6'.",
            )
        scope = (parts[0], parts[1])
        _check_group(scope, text)
        parts = parts[2:]
    of_run = (*COUNTS, WHOLE_TRACK, *section_quantities())
    known = [*GATED, *(of_run if scope is None else COUNTS[:2])]
    words = next((words for words in range(len(parts), 0, -1) if _is_known(parts[:words], known, scope)), 0)
    name, ends = ".".join(parts[:words]), parts[words:]
    if not words and (of_probe := probe_column(parts, text)) is not None:
        return of_probe[0], scope, of_probe[1]
    if not words:
        names = known if scope else [*known, *DIMENSIONS, *VERSUS, EQUIVALENT, *ARMS]
        begun = any(one.startswith(f"{parts[0]}.") for one in known)
        name = quantity if begun and scope is None else parts[0]
        meant = OTHER_NAMES.get(name)
        hint = did_you_mean(name, names) if meant is None else f"Did you mean {meant!r}?"
        raise refused(text, f" has the unknown quantity {name!r}. {hint}")
    quantity_of_row = GATED.get(name)
    has_ends = section_of(name) is not None or (
        quantity_of_row is not None and quantity_of_row.format.has_interval
    )
    if len(ends) > 1 or (ends and not has_ends):
        raise refused(text, f" asks for {'.'.join(ends)!r} of {name}, which has no such part.")
    return name, scope, _end(ends[0] if ends else None, text)


def _is_known(parts: Sequence[str], known: Sequence[str], scope: tuple[str, str] | None) -> bool:
    name = ".".join(parts)
    return name in known or (scope is None and section_of(name) is not None)


def _end(end: str | None, text: str) -> str | None:
    if end not in (None, "lower", "upper"):
        raise refused(text, f" has the unknown part {end!r}. {did_you_mean(end, ('lower', 'upper'))}")
    return end


def require_known_groups(gates: Iterable[Gate], pairs: Iterable[PlannedPair]) -> None:
    """Refuse gates on groups that no pair can be in."""
    every = tuple(pairs)
    for gate in gates:
        if gate.scope is not None:
            dimension, group = gate.scope
            groups = {DIMENSIONS[dimension].label(pair) for pair in every}
            if group not in groups:
                raise refused(
                    gate.text,
                    f" names the {dimension} {group!r}, which no case is of. {did_you_mean(group, groups)}",
                )


def _check_group(scope: tuple[str, str], text: str) -> None:
    """Refuse names that no report can have; other groups depend on the run."""
    known = {"event": tuple(EVENTS), "family": families()}.get(scope[0])
    if known is not None and scope[1] not in known:
        raise refused(text, f" has the unknown {scope[0]} {scope[1]!r}. {did_you_mean(scope[1], known)}")


def _in_block(gate: Gate, report: Report) -> tuple[float | None, str]:
    block = report.overall
    where = "the run"
    if gate.scope is not None:
        dimension, group = gate.scope
        groups = report.by[dimension]
        if group not in groups:
            return None, f"the run has no {dimension} {group!r}. {did_you_mean(group, groups)}"
        block, where = groups[group], f"{dimension} {group}"
    if gate.name in COUNTS:
        return (block.planned if gate.name == "planned" else block.played), ""
    if block.played < block.planned:
        return None, f"{block.played} of {block.planned} planned pairs of {where} were played"
    column = row_quantity(gate.name)
    if column.of_change and (lacks := lacks_of(block)):
        return None, f"of {where}, {'; '.join(lacks)}"
    found, number = column.value(block), value_in(gate, block)
    if number is None and isinstance(found, TaskInterval) and block.played:
        return None, f"of {where}, {lack_of_tasks(found)}"
    return number, f"{where} has no pair to measure {gate.name} on"


def equivalence_interval(contrast: SuccessContrast) -> Interval | None:
    """Return the 90% interval of Dynamic success less that of another run; None without a common case."""
    from pytest_libero_max.stats.paired_difference import paired_difference

    return paired_difference(
        contrast.first_only, contrast.second_only, contrast.cases, EQUIVALENCE_CONFIDENCE
    )


def value_in(gate: Gate, row: Any) -> float | None:
    """Return the quantity of a gate in the result of a set of pairs; None where it cannot be measured."""
    column = row_quantity(gate.name)
    value: float | None = column.format.numbers(column.value(row))[f"_{gate.end}" if gate.end else ""]
    return value


def decided_value(gate: Gate, row: Any) -> float | None:
    """Return :func:`value_in`; None also where the change of these pairs says nothing of the event."""
    return None if row_quantity(gate.name).of_change and lacks_of(row) else value_in(gate, row)


def verdict_in(gate: Gate, row: Any) -> Verdict:
    """Return the verdict on a gate over a set of pairs all of which are played; see :func:`value_in`."""
    value = decided_value(gate, row)
    return "undecidable" if value is None else "passed" if meets(gate, value) else "failed"


def _whole_track(report: Report) -> tuple[float | None, str]:
    selection = report.selection
    if selection is None:
        return None, "the run does not say what part of its track it is"
    name = report.provenance["case_set"]["name"].removeprefix("track ")
    if selection.whole and name in all_track_names() and selection.of != len(load_track(name)):
        cases = counted(selection.of, "case")
        return None, f"the run says that {name} has {cases}, but it has {len(load_track(name))}"
    return int(selection.whole and not report.pairs.unsupported), ""


def _versus(
    gate: Gate, report: Report, contrasts: Mapping[str, SuccessContrast | str]
) -> tuple[float | None, str]:
    contrast = contrasts.get(gate.run or "", f"there is no comparison with {gate.run!r}")
    if isinstance(contrast, str):
        return None, contrast
    if lack := lack_of_run(report):
        return None, lack
    if gate.name == EQUIVALENT:
        return versus_value(gate, contrast), "there is no common case"
    return versus_value(gate, contrast), f"no case tells this run and {gate.run!r} apart"


def versus_value(gate: Gate, contrast: SuccessContrast) -> float | None:
    """Return the quantity of a gate against another run; None without a case."""
    if gate.name == EQUIVALENT:
        interval = equivalence_interval(contrast)
        return None if interval is None else max(-interval.lower, interval.upper)
    found = VERSUS[gate.name][0](contrast)
    return getattr(found, gate.end or "value") if isinstance(found, SuccessDifference) else found
