"""Alarms of monitors, counted from made-up pairs."""

from __future__ import annotations

from msgspec.structs import replace

from pytest_libero_max.lab.sections.monitors import FALSE_ALARMS, LEAST, Monitors
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.report_section import PlayedPairs
from pytest_libero_max.report.writers.markdown import markdown
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, plan, record_of, texts_of

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


def test_alarms_after_the_event_are_counted_in_both_arms() -> None:
    records = [scored(number, noisy(number), LOUD_LATE) for number in range(len(PLANNED))]
    (table,) = map(texts_of, Monitors().tables(PlayedPairs(records)).values())
    assert table["Pairs watched"] == len(PLANNED)
    false = int(str(table["Base with an alarm (10% are allowed)"]).split()[-1].split("/")[0])
    assert 0 < false <= 2 * FALSE_ALARMS * len(PLANNED)
    assert table["Alarm before the event already"] == f"0.0%  0/{len(PLANNED)}"
    assert str(table["Alarm after the event, Base at the same step"]).endswith(f"0/{len(PLANNED)}")
    assert str(table["Alarm after the event, Dynamic"]).endswith(f"{len(PLANNED)}/{len(PLANNED)}")
    assert str(table["Alarm after the event, paired change"]).startswith("+100.0 pp [")
    assert table["Steps from event to alarm, median"] == f"7.0 steps  {len(PLANNED)}/{len(PLANNED)} pairs"
    assert str(table["Regressions with an alarm after the event"]).startswith("100.0%")
    assert str(table["Steps from alarm to the end of a regression, median"]).startswith("65.0 steps")
    assert table["... camera_shift: alarm in Base"] == "0.0%  0/8"
    assert table["... camera_shift: alarm in Dynamic"] == "100.0%  8/8"
    assert table["... camera_shift: steps to it, median"] == "7.0 steps  8/8 pairs"


def test_the_threshold_of_a_half_is_that_of_the_other_half() -> None:
    # A case that is loud in Base raises its own half's alarms only if the other half is calm.
    records = [scored(number, CALM, CALM) for number in range(len(PLANNED))]
    records[0] = scored(0, LOUD_LATE, LOUD_LATE)
    (table,) = map(texts_of, Monitors().tables(PlayedPairs(records)).values())
    assert str(table["Base with an alarm (10% are allowed)"]).endswith(f"1/{len(PLANNED)}")
    assert str(table["Alarm after the event, paired change"]).startswith("+0.0 pp [")


def test_without_a_regression_or_an_event_it_says_so() -> None:
    records = [scored(number, CALM, CALM, (True, True)) for number in range(len(PLANNED))]
    (table,) = map(texts_of, Monitors().tables(PlayedPairs(records)).values())
    assert table["Regressions with an alarm after the event"] == "n/a  0/0"
    assert str(table["Steps from event to alarm, median"]).startswith("n/a  0/")
    assert table["... camera_shift: alarm in Dynamic"] == "0.0%  0/8"
    unfired = []
    for number, pair in enumerate(PLANNED):
        arms = scored(number, CALM, CALM).arms
        record = record_of(pair, True, True, **NEVER_TRIGGERED)
        probed = {name: replace(arm, probes=arms[name].probes) for name, arm in record.arms.items()}
        unfired.append(replace(record, arms=probed))
    (table,) = map(texts_of, Monitors().tables(PlayedPairs(unfired)).values())
    assert table["Pairs in which the event happened"] == 0
    assert "Alarm before the event already" not in table


def test_few_pairs_have_no_threshold() -> None:
    (table,) = map(texts_of, Monitors().tables(PlayedPairs([scored(0, CALM, CALM)])).values())
    assert str(table["Alarms"]).startswith(
        f"n/a: a threshold needs {LEAST} pairs in each half, but there are "
    )


def test_it_is_a_section_of_the_report_for_each_monitor_and_for_no_other_probe() -> None:
    records = [scored(number, CALM, LOUD_LATE) for number in range(len(PLANNED))]
    text = markdown(build_report(records, [], PLANNED, PROVENANCE))
    assert TITLE in text
    assert "| Steps from event to alarm, median | 7.0 steps " in text
    assert Monitors().tables(PlayedPairs([record_of(PLANNED[0], True, True)])) == {}
