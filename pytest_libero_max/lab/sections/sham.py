"""Chance: the sham event besides the event, and Base played twice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from pytest_libero_max.errors import counted
from pytest_libero_max.events.schedules import BASE, DYNAMIC, SHAM, SHAM_DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.formats import percent
from pytest_libero_max.report.measures import Measured, Rows, measure_text, measures_of
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sections import Chance, PlayedPairs, ReportSection
from pytest_libero_max.stats.blocks import Measure
from pytest_libero_max.stats.measured import mean_difference_of, rate_of, tabulate
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.ratios import Ratio

TITLE = "Sham event: other seeds alone"
NOTE = (
    "At the event's moment the policy is given other seeds, and nothing changes. Of rollouts that are played "
    "twice, flips by chance are the mean of those of two Bases and of two Dynamics; flips beyond chance are "
    "the mean of (Dynamic - Base) of the first rollouts times that of the second, which is without bias."
)
INTERVAL_NOTE = (
    "Where the interval of the flips beyond chance holds 0, the policy's own chance may explain all flips."
)

NOISE_TITLE = "Noise floor: Base played twice"
_NOISE = Measured("noise_floor.flips", "A second Base ends otherwise", "share", line=NOISE_TITLE)
_ALIKE = Measured("noise_floor.identical", "A second Base is the same bit for bit", "share")

_IDENTICAL = Measured("sham.identical", "The same as Base bit for bit", "share")
_LOST = Measured("sham.lost", "Base successes lost by the sham event", "share", line="Lost to other seeds")
_GAINED = Measured("sham.gained", "Base failures gained by the sham event", "share")
_EVENT_LOST = Measured(
    "sham.event_lost", "Base successes lost by the event", "share", line="... by the event, same pairs"
)
_LESS_SHAM = Measured(
    "beyond_sham", "Dynamic less sham", "change", line="... Dynamic less other seeds", of_change=True
)
_FLIPS = Measured(
    "sham.flips", "Flips: Base and Dynamic end differently", "share", line="Base and Dynamic differ"
)
_BASE_FLIPS = Measured("sham.flips.base", "... two Bases", "share")
_DYNAMIC_FLIPS = Measured("sham.flips.dynamic", "... two Dynamics", "share")
_FLOOR = Measured("sham.floor", "... by chance", "share", line="... by chance")
_BEYOND = Measured("sham.flips.beyond", "... beyond chance", "change", line="... beyond chance")


class NoiseFloor(ReportSection):
    """Pairs that played Base twice (``--libero-max-noise=floor:PAIRS``)."""

    name = "noise-floor"
    quantities = (_NOISE, _ALIKE)
    option = "--libero-max-noise=floor:PAIRS"

    def tables(self, played: PlayedPairs) -> dict[str, Rows]:
        repeated = [(it.base_success, it.base_repeat) for it in played.records if it.base_repeat]
        if not repeated:
            return {}
        flips = _NOISE.share(repeat["success"] != base for base, repeat in repeated)
        alike = _ALIKE.share((repeat["identical"] for _, repeat in repeated), with_interval=False)
        return {NOISE_TITLE: flips | alike}

    def warnings(self, report: Report) -> list[str]:
        noise = measures_of(report.sections).get(_NOISE.key)
        asked, pairs = report.provenance["protocol"].get("noise_floor") or 0, noise.of if noise else 0
        if (pairs or 0) >= asked:
            return []
        return [f"The noise floor was asked for on {asked} pairs, and measured on {pairs}."]


class Sham(ReportSection):
    """Pairs that played the sham event (``noise=sham:SHARE``)."""

    name = "sham"
    quantities = (
        _IDENTICAL,
        _LOST,
        _GAINED,
        _EVENT_LOST,
        _LESS_SHAM,
        _FLIPS,
        _BASE_FLIPS,
        _DYNAMIC_FLIPS,
        _FLOOR,
        _BEYOND,
    )
    option = "--libero-max-noise=sham:SHARE"
    notes: ClassVar[Mapping[str, str]] = {TITLE: NOTE}
    interval_notes: ClassVar[Mapping[str, str]] = {TITLE: INTERVAL_NOTE}

    def tables(self, played: PlayedPairs) -> dict[str, Rows]:
        records = [record for record in played.records if SHAM in record.arms]
        if not records:
            return {}
        base = [record.base_success for record in records]
        sham = [bool(record.arms[SHAM].success) for record in records]
        dynamic = [record.dynamic_success for record in records]
        by_sham, by_event = tabulate(base, sham), tabulate(base, dynamic)
        gained = Ratio(by_sham.change_associated_success, by_sham.total - by_sham.base.count)
        rows: Rows = {"Pairs": len(records)}
        rows |= _IDENTICAL.share(
            [record.arms[SHAM].proof == record.arms[BASE].proof for record in records], with_interval=False
        )
        rows |= _LOST.ratio(rate_of(by_sham.conditional_regression)) | _GAINED.ratio(rate_of(gained))
        rows |= _EVENT_LOST.ratio(rate_of(by_event.conditional_regression))
        rows |= _LESS_SHAM.change(sham, dynamic)
        rows |= chance_rows([record for record in records if SHAM_DYNAMIC in record.arms])
        return {TITLE: rows}

    def chance(self, measures: Mapping[str, Measure]) -> Chance | None:
        lost, gained = measures.get(_LOST.key), measures.get(_GAINED.key)
        if lost is None or gained is None:
            return None
        pairs = (lost.of or 0) + (gained.of or 0)
        return Chance("the sham event", lost.count or 0, gained.count or 0, pairs)

    def warnings(self, report: Report) -> list[str]:
        measures, asked = measures_of(report.sections), report.provenance["protocol"].get("sham")
        warnings = []
        if asked and _LOST.key not in measures:
            warnings.append(
                f"The sham event was asked for on {asked:.0%} of the pairs, and none of these was played."
            )
        if report.policy is None or report.policy.get("repeatable", True):
            return warnings
        flips, beyond = measures.get(_FLIPS.key), measures.get(_BEYOND.key)
        size = (
            "No pair of this run was played twice, so the size of this chance is not known: "
            "--libero-max-noise=sham:1."
            if flips is None
            else f"{measures[_IDENTICAL.key].of} of {counted(report.pairs.played, 'pair')} measured it."
        )
        warnings.append(
            "NOT REPEATABLE: this policy draws noise that no seed of ours sets, so that a pair may end "
            "otherwise when it is played again. Paired changes are not biased by it, but lost and gained "
            f"pairs hold this chance as well as the event. {size}"
        )
        if flips is None or beyond is None:
            return warnings
        return [*warnings, *_floor_texts(flips, measures[_FLOOR.key].value or 0.0, beyond)]


def chance_rows(records: Sequence[PairRecord]) -> Rows:
    """Return the flips by chance and beyond it, of pairs with both rollouts played twice; empty without any.

    With success probabilities b and d after the event, a pair flips with b (1 - d) + d (1 - b), two Bases
    differ with 2 b (1 - b) and two Dynamics with 2 d (1 - d). Flips less the mean of these is (d - b)
    squared, which is the expectation of the product of two independent differences.
    """
    if not records:
        return {}
    ends = [
        tuple(bool(record.arms[name].success) for name in (BASE, DYNAMIC, SHAM, SHAM_DYNAMIC))
        for record in records
    ]
    pairs = len(ends)
    bases = [base != again for base, _, again, _ in ends]
    dynamics = [dynamic != again for _, dynamic, _, again in ends]
    products = [(dynamic - base) * (other - again) for base, dynamic, again, other in ends]
    alike, opposite = products.count(1), products.count(-1)
    beyond = mean_difference_of(Ratio(alike - opposite, pairs), paired_difference(opposite, alike, pairs))
    rows = _FLIPS.share([base != dynamic for base, dynamic, _, _ in ends])
    rows |= _BASE_FLIPS.share(bases) | _DYNAMIC_FLIPS.share(dynamics)
    rows |= _FLOOR.row((sum(bases) + sum(dynamics)) / (2 * pairs))
    return rows | _BEYOND.ratio(beyond)


def _floor_texts(flips: Measure, floor: float, beyond: Measure) -> Iterator[str]:
    """Yield a sentence that calls a floor as large as the effect so; none for a smaller floor."""
    if not (flips.count or floor) or beyond.lower is None or beyond.lower > 0.0:
        return
    observed = (
        f"of {counted(flips.of or 0, 'pair')} that were played twice, Base and Dynamic end differently in "
        f"{percent(flips.value)}, and two plays of the same arm in {percent(floor)}."
    )
    reading = "read the paired change with its interval, and no single pair."
    if floor >= (flips.value or 0.0):
        yield (
            f"THE FLOOR IS AS LARGE AS THE EFFECT ON SINGLE PAIRS: {observed} This policy's own chance alone "
            f"makes as many lost and gained pairs: {reading}"
        )
    else:
        yield (
            f"THE FLOOR MAY BE AS LARGE AS THE EFFECT ON SINGLE PAIRS: {observed} What is beyond chance, "
            f"{measure_text(beyond)}, is not shown to be above 0: {reading}"
        )
