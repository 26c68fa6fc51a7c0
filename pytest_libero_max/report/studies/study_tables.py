"""A study as tables and sentences, which every writer of a report prints in its own way."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from pytest_libero_max.report.document import Table
from pytest_libero_max.report.formats import (
    NOT_AVAILABLE,
    Change,
    Counts,
    Format,
    Interval,
    Percent,
    Rate,
    counted,
    interval_text,
    percent,
)
from pytest_libero_max.report.quantities import Cell
from pytest_libero_max.report.render.terminal import aligned
from pytest_libero_max.report.studies.study_document import (
    Approach,
    Cadence,
    CadenceSetting,
    Camera,
    Executed,
    Latencies,
    Setting,
    Study,
)
from pytest_libero_max.stats.blocks import Bootstrap, StaleActions
from pytest_libero_max.stats.condition_blocks import (
    BestSetting,
    ConditionContrast,
    GroupInterval,
    SettingDifference,
)

_LISTED = 16
"""Number of joint outcomes that are printed; ``report.json`` has all."""

_ENOUGH = 30
"""With fewer cases, a percentile interval is too narrow."""


def study_tables(study: Study) -> list[Table]:
    """Return the tables of a study, in the order in which they are read.

    Args:
        study: ``report.study``.
    """
    if study.cases == 0:
        return []
    if study.camera is not None:
        return _camera(study.camera)
    if study.latency is not None:
        return [_latency(study.latency)]
    if study.cadence is not None:
        return _cadence(study.cadence)
    if study.by_event is not None:
        return [*_arms(study)]
    return [_success_by_arm(study)]


def study_notes(study: Study) -> list[str]:
    """Return the notes on the whole study."""
    if study.cases == 0:
        return ["No case of the study has been measured."]
    done = study.executed
    ways = [_way(done, done.steps_singly, done.queries_singly, "with every arm played by itself")]
    if study.camera is not None:
        as_pairs = "with a Base for every other arm, as in runs of their own"
        ways.append(_way(done, done.steps_as_pairs, done.queries_as_pairs, as_pairs))
    notes = [
        f"{counted(study.cases, 'case')}, {counted(done.arms, 'arm')}. What arms share was executed once: "
        f"{done.steps:,} steps and {done.queries:,} queries, against {' and '.join(ways)}."
    ]
    if study.camera is not None:
        notes.append(
            "The first crossing of the trigger's distance was computed again from the trajectories of Base "
            "and Mid-task, and the camera after Reset compared with the one after Mid-task: a pair in which "
            "the crossing is not the logged one, or the cameras differ, is invalid."
        )
        if study.cases < _ENOUGH:
            notes.append(
                f"With fewer than {_ENOUGH} cases the intervals that resample cases are too narrow. Read the "
                "exact ones."
            )
    elif study.cadence is not None and len({setting.horizon for setting in study.cadence.settings}) > 1:
        notes.append("H differs between the settings, so differences between them are not those of Q alone.")
    if study.cadence is not None and any(
        (setting.returned or setting.horizon) > setting.horizon for setting in study.cadence.settings
    ):
        notes.append(
            "A cut chunk is the beginning of a longer one: a policy with that H of its own may answer "
            "otherwise."
        )
    return notes


def _way(done: Executed, steps: int, queries: int, words: str) -> str:
    """Cost of another way of playing the same arms, in words."""
    saved = 1 - done.steps / steps if steps else 0.0
    return f"{steps:,} and {queries:,} {words} ({percent(saved)} of the steps saved)"


def study_lines(study: Study) -> list[str]:
    """Return the study for the terminal: title, short tables and notes on the whole."""
    from textwrap import wrap

    lines = ["", f"Study: {study.title}"]
    for table in study_tables(study):
        if table.narrow:
            narrow = [row[: table.narrow] for row in (table.headings(), *table.texts())]
            lines += ["", *aligned(narrow)]
    for note in study_notes(study):
        lines += ["", *wrap(note, 100)]
    return lines


def study_csv(study: Study) -> str:
    """Return all numbers of a study as CSV, one a row: its place in ``report.study``, and its value.

    Shares are fractions; a value that does not exist is empty.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(("place", "value"))
    writer.writerows(_leaves("", msgspec.to_builtins(study)))
    return buffer.getvalue()


def _leaves(place: str, value: Any) -> list[tuple[str, Any]]:
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = {str(index): item for index, item in enumerate(value)}.items()
    else:
        return [(place, "" if value is None else value)]
    return [leaf for key, item in items for leaf in _leaves(f"{place}.{key}" if place else str(key), item)]


def _arms(study: Study) -> Iterator[Table]:
    """Yield the tables of arms: success, and the contrasts of all cases and of each event."""
    arms, by_event = study.arms or {}, study.by_event or {}
    yield _success_by_arm(study)
    yield Table(
        "Success by arm and event",
        ("Event", *arms),
        [
            (event, *(Cell(rates[arm], Counts()) if arm in rates else "" for arm in arms))
            for event, rates in by_event.items()
        ],
        narrow=1 + len(arms),
    )
    contrasts = study.contrasts or []
    names = list(dict.fromkeys(f"{row.first} - {row.second}" for row in contrasts))
    changes = [
        (
            event or "all",
            *(Cell(row, Change()) if row.cases else "" for row in contrasts if row.event == event),
        )
        for event in dict.fromkeys(row.event for row in contrasts)
    ]
    yield Table(
        "Contrasts of arms",
        ("Event", *names),
        changes,
        "Over the cases that were played in both. Exact 95% intervals, each for itself.",
        narrow=1 + len(names),
    )


def _success_by_arm(study: Study) -> Table:
    rows = [(name, Cell(rate, Rate())) for name, rate in (study.arms or {}).items()]
    note = "Each arm over the cases that were played in it. All other numbers are of base and dynamic."
    return Table("Success by arm", ("Arm", "Success"), rows, note, narrow=2)


# Camera timing and strength.

_BOOTSTRAP = "Paper's bootstrap"
"""Heading of the paper's interval, which has no width where all cases of each source are alike."""


@dataclass(frozen=True)
class _Bootstrap(Interval):
    """The paper's interval, which has no width where all cases of each source are alike."""

    def long(self, value: Bootstrap) -> str:
        return "n/a: all alike" if value.degenerate else interval_text(value, self.signed)


@dataclass(frozen=True)
class _Groups(Interval):
    """An interval over groups of cases."""

    def long(self, value: GroupInterval) -> str:
        if value.lower is None:
            return f"too few ({value.groups}, changed {value.changed})"
        return f"{interval_text(value, self.signed)}  {value.groups} groups"


def _camera(study: Camera) -> list[Table]:
    labels = study.conditions
    sources = sorted(next(iter(study.rates.values())).by_source)
    rates = [
        (
            labels[arm],
            Cell(rate, Rate()),
            *(Cell(rate.by_source[source], Rate()) for source in sources),
            Cell(rate.bootstrap, _Bootstrap(signed=False)),
        )
        for arm, rate in study.rates.items()
    ]
    return [
        Table(
            "Success",
            ("Condition", "All", *sources, _BOOTSTRAP),
            rates,
            "Exact 95% intervals. The paper's are percentiles of the exact bootstrap distribution, with the "
            "composition of the sources kept: for comparison with it, and far too narrow for rare outcomes.",
            narrow=2,
        ),
        _joint(study),
        *_contrasts(study, sources),
        _approach(study),
    ]


def _joint(study: Camera) -> Table:
    rows = [(*(int(row.success[arm]) for arm in study.conditions), row.cases) for row in study.outcomes]
    left = len(rows) - _LISTED
    return Table(
        "Outcomes together",
        (*study.conditions.values(), "Cases"),
        rows[:_LISTED],
        "1 for a success." + (f" {left} rarer combinations are in report.json." if left > 0 else ""),
    )


def _contrasts(study: Camera, sources: Sequence[str]) -> list[Table]:
    labels = study.conditions
    rows = [
        (
            f"{labels[row.first]} - {labels[row.second]}",
            row.gains,
            row.losses,
            Cell(row, Change()),
            Cell(row.bootstrap, _Bootstrap()),
        )
        for row in study.contrasts
    ]
    tables = [
        Table(
            "Paired contrasts",
            ("Contrast", "Gain", "Loss", "Difference", _BOOTSTRAP),
            rows,
            "Gain: only the first condition succeeds; loss: only the second. The interval of the difference "
            "is exact; the paper's resamples cases within each source, and is too narrow where few differ. "
            "All are pointwise: no number of contrasts is corrected for. Reset and Mid-task differ in more "
            "than the moment: in how long the new view is seen, in the states visited and in the steps left.",
            narrow=5,
        )
    ]
    named = [(f"{labels[row.first]} - {labels[row.second]}", row) for row in study.contrasts]
    if study.gap_contrasts:
        gaps = [(_gap_label(row), row) for row in study.gap_contrasts]
        named += gaps
        tables.append(
            Table(
                "Mid-task less Reset, between strengths",
                ("Contrast", "Difference", _BOOTSTRAP),
                [(label, Cell(row, Change()), Cell(row.bootstrap, _Bootstrap())) for label, row in gaps],
            )
        )
    tables.append(
        Table(
            "Contrasts by source, and over groups of cases",
            ("Contrast", *sources, "Reference tasks", "Tasks of each source", "Configurations"),
            [
                (
                    label,
                    *(Cell(row.by_source[source], Change()) for source in sources),
                    *(Cell(group, _Groups()) for group in row.by_groups.values()),
                )
                for label, row in named
            ],
            "By source, the same interval as over all cases. Reference tasks are resampled jointly across "
            "the sources, whose shares stay fixed; tasks of each source, and configurations (task and "
            "initial state), within each source. The case-weighted estimate stays the same.",
        )
    )
    return tables


def _gap_label(row: ConditionContrast) -> str:
    return f"(Mid-task - Reset) at {_percent(row.first)} - at {_percent(row.second)}"


def _percent(strength: str) -> str:
    return f"{float(strength):.0%}"


def _approach(study: Camera) -> Table:
    strengths = study.approach
    named = tuple(f"at {_percent(strength)}" for strength in strengths) if len(strengths) > 1 else ("Number",)
    rows = [(label, *(count(strengths[strength]) for strength in strengths)) for label, count in _APPROACH]
    return Table("Approach", ("Cases", *named), rows)


_APPROACH: tuple[tuple[str, Callable[[Approach], int]], ...] = (
    ("Event fired in Mid-task", lambda row: row.triggered),
    ("... and a query followed it", lambda row: row.query_after_the_event),
    (
        "Reset fails, the hand never came within the trigger's distance",
        lambda row: row.reset.failed_never_entered,
    ),
    ("Reset fails after it came within the distance", lambda row: row.reset.failed_entered),
    (
        "Reset succeeds without coming within the distance",
        lambda row: row.reset.succeeded_never_entered,
    ),
    ("Reset succeeds after it came within the distance", lambda row: row.reset.succeeded_entered),
    (
        "Base and Mid-task succeed, Reset fails",
        lambda row: row.base_and_middle_succeed_reset_fails.cases,
    ),
    (
        "... of these: Reset never came within the distance",
        lambda row: row.base_and_middle_succeed_reset_fails.reset_never_entered,
    ),
    (
        "Base and Reset succeed, Mid-task fails",
        lambda row: row.base_and_reset_succeed_middle_fails.cases,
    ),
    (
        "... of these: a query followed the event",
        lambda row: row.base_and_reset_succeed_middle_fails.with_a_query_after_the_event,
    ),
    (
        "... of these: and no stale action was executed",
        lambda row: row.base_and_reset_succeed_middle_fails.without_stale_actions,
    ),
)


# Query cadence and latency.


def setting_text(setting: CadenceSetting) -> str:
    """Return H and Q of a setting, ``H=30 (cut to 2) Q=2`` where the policy returned 30 actions."""
    label, whole = setting.label, setting.returned or setting.horizon
    if whole > setting.horizon:
        label = f"H={whole} (cut to {setting.horizon}) Q={setting.query_interval}"
    return label + (" (own)" if setting.own else "")


def _rates_of(setting: Setting) -> tuple[Cell, ...]:
    return (
        Cell(setting.base_success, Rate()),
        Cell(setting.dynamic_success, Rate()),
        Cell(setting.paired_change, Change()),
    )


@dataclass(frozen=True)
class _Stale(Format):
    """Median and mean of stale actions."""

    def long(self, value: StaleActions) -> str:
        return NOT_AVAILABLE if value.mean is None else f"{value.median:g} / {value.mean:.2f}"

    def numbers(self, value: StaleActions) -> dict[str, float | None]:
        return {"_median": value.median, "_mean": value.mean}


def _cadence(study: Cadence) -> list[Table]:
    rows = [
        (
            setting_text(setting),
            *_rates_of(setting),
            Cell(setting.conditional_regression.value, Percent()),
            Cell(setting.response_coverage, Counts()),
            Cell(setting.stale_actions, _Stale()),
        )
        for setting in study.settings
    ]
    head = ("Setting", "Base", "Dynamic", "Change", "Lost", "Query after", "Stale")
    return [
        Table(
            "Settings",
            head,
            rows,
            "Every setting has an executed prefix of its own. Stale: median and mean of the actions executed "
            "between the event and the next query, which is a delay of feedback and no measure of safety. A "
            "smaller change alone is no better result: read it with Dynamic success.",
            narrow=4,
        ),
        *(
            _best(what, study.best[key])
            for what, key in (("Base", "base_success"), ("Dynamic", "dynamic_success"))
        ),
    ]


def _latency(study: Latencies) -> Table:
    rows = [
        (
            setting.label,
            *_rates_of(setting),
            "" if setting.own else Cell(setting.base_cost, Change()),
            "" if setting.own else Cell(setting.dynamic_cost, Change()),
            Cell(setting.conditional_regression.value, Percent()),
            Cell(setting.stale_actions, _Stale()),
            Cell(setting.held, Percent()),
        )
        for setting in study.settings
    ]
    head = ("Delay", "Base", "Dynamic", "Change", "Base: cost", "Dynamic: cost", "Lost", "Stale", "Waiting")
    return Table(
        "Delays",
        head,
        rows,
        "d: control steps from an observation to the first action that may follow from it. Until the answer "
        "is there the robot goes on with the chunk before; sync: it waits. Cost: success less that without "
        "delay, over the same cases. Stale: median and mean of the steps from the event to the first action "
        "after a query that followed it. Waiting: share of the steps without an action to execute. Every "
        "delay has an executed prefix of its own.",
        narrow=4,
    )


def _best(what: str, best: BestSetting) -> Table:
    rows: list[tuple[Any, ...]] = [(best.setting, Cell(best, Rate()), "best")]
    rows += [
        (
            name,
            Cell(_turned(difference), Change()),
            "not shown to be worse" if name in best.not_worse else "worse",
        )
        for name, difference in best.differences.items()
    ]
    return Table(
        f"Best setting for {what}",
        (f"Best for {what}", "Success, or less than the best", "Verdict"),
        rows,
        "The first of equals is listed as the best. The intervals account for the choice: those of all rates "
        "hold together with 95%, and so do those of the differences of all pairs of settings.",
        narrow=3,
    )


def _turned(difference: SettingDifference) -> SettingDifference:
    """Return the difference the other way round."""

    def negative(value: float | None) -> float | None:
        return None if value is None else 0.0 - value

    return SettingDifference(
        value=negative(difference.value),
        lower=negative(difference.upper),
        upper=negative(difference.lower),
    )
