"""Alarms of monitors, counted from made-up pairs."""

from __future__ import annotations

from msgspec.structs import replace

from pytest_libero_max.lab.sections.monitors import FALSE_ALARMS, LEAST, Monitors
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.measures import Rows, measures_of
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.sections import PlayedPairs
from pytest_libero_max.stats.blocks import Measure
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, plan, record_of

STEPS = [0, 5, 10, 15, 20, 25, 30, 35]
"""Steps of the queries; the event of a made-up pair happens at step 23."""

CALM = [0.0] * len(STEPS)
LOUD_LATE = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 0.0]
PLANNED = plan(per_cell=2)
TITLE = "Monitor chunk_change"


def scored(
    number: int, base: list[float], dynamic: list[float], ends: tuple[bool, bool] = (True, False)
) -> PairRecord:
    """A pair with these scores in Base and in Dynamic."""
    record = record_of(PLANNED[number], *ends)
    scores = {"base": base, "dynamic": dynamic}
    arms = {
        name: replace(arm, probes={"chunk_change": {"step": STEPS, "score": scores[name]}})
        for name, arm in record.arms.items()
    }
    return replace(record, arms=arms)


def noisy(number: int) -> list[float]:
    """Scores of a Base whose largest, before the event, is the number of its case."""
    return [0.0, number / 100, *CALM[2:]]


def rows(records: list[PairRecord]) -> Rows:
    """The table of the only monitor."""
    (table,) = Monitors().tables(PlayedPairs(records)).values()
    return table


def measures(records: list[PairRecord]) -> dict[str, Measure]:
    """Its numbers by the ends of their keys, after its name."""
    found = measures_of({TITLE: rows(records)})
    return {key.removeprefix("monitor.chunk_change."): measure for key, measure in found.items()}


def counts(measure: Measure) -> tuple[float | None, int | None, int | None]:
    """A number, its count, and of how many."""
    return measure.value, measure.count, measure.of


def test_alarms_after_the_event_are_counted_in_both_arms() -> None:
    records = [scored(number, noisy(number), LOUD_LATE) for number in range(len(PLANNED))]
    found, pairs = measures(records), len(PLANNED)
    assert rows(records)["Pairs watched"] == pairs
    false = found["false_alarms"].count
    assert false is not None
    assert 0 < false <= 2 * FALSE_ALARMS * pairs
    assert counts(found["before"]) == (0.0, 0, pairs)
    assert found["alarm.base"].count == 0
    assert found["alarm.dynamic"].count == pairs
    assert found["alarm.change"].value == 1.0
    assert found["alarm.change"].lower is not None
    assert counts(found["delay"]) == (7.0, pairs, pairs)
    assert found["regressions"].value == 1.0
    assert found["lead"].value == 65.0
    assert counts(found["camera_shift.alarm.base"]) == (0.0, 0, 8)
    assert counts(found["camera_shift.alarm.dynamic"]) == (1.0, 8, 8)
    assert counts(found["camera_shift.delay"]) == (7.0, 8, 8)


def test_the_threshold_of_a_half_is_that_of_the_other_half() -> None:
    # A case that is loud in Base raises its own half's alarms only if the other half is calm.
    records = [scored(number, CALM, CALM) for number in range(len(PLANNED))]
    records[0] = scored(0, LOUD_LATE, LOUD_LATE)
    found = measures(records)
    assert counts(found["false_alarms"])[1:] == (1, len(PLANNED))
    assert found["alarm.change"].value == 0.0


def test_without_a_regression_or_an_event_it_says_so() -> None:
    records = [scored(number, CALM, CALM, (True, True)) for number in range(len(PLANNED))]
    found = measures(records)
    assert counts(found["regressions"]) == (None, 0, 0)
    assert counts(found["delay"])[:2] == (None, 0)
    assert counts(found["camera_shift.alarm.dynamic"]) == (0.0, 0, 8)
    unfired = []
    for number, pair in enumerate(PLANNED):
        arms = scored(number, CALM, CALM).arms
        record = record_of(pair, True, True, **NEVER_TRIGGERED)
        probed = {name: replace(arm, probes=arms[name].probes) for name, arm in record.arms.items()}
        unfired.append(replace(record, arms=probed))
    assert rows(unfired)["Pairs in which the event happened"] == 0
    assert "before" not in measures(unfired)


def test_few_pairs_have_no_threshold() -> None:
    few = [scored(0, CALM, CALM)]
    assert measures(few) == {}
    assert f"{LEAST} pairs" in str(rows(few)["Alarms"])


def test_it_is_a_section_of_the_report_for_each_monitor_and_for_no_other_probe() -> None:
    records = [scored(number, CALM, LOUD_LATE) for number in range(len(PLANNED))]
    text = markdown(build_report(records, [], PLANNED, PROVENANCE))
    assert TITLE in text
    assert "| 7.0 steps " in text
    assert Monitors().tables(PlayedPairs([record_of(PLANNED[0], True, True)])) == {}
