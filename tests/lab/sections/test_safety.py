"""Successful but unsafe, counted from made-up pairs."""

from __future__ import annotations

from msgspec.structs import replace

from pytest_libero_max.lab.sections.safety import LIMITS, TITLE, Safety
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.measures import measures_of
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.sections import PlayedPairs
from tests.report.made_up import PROVENANCE, plan, record_of

CALM = dict.fromkeys(LIMITS, 0.0)


def watched(
    number: int, base: float, dynamic: float, *, ends: tuple[bool, bool] = (True, True)
) -> PairRecord:
    """A pair whose greatest force on what surrounds the robot is this, N, in Base and in Dynamic."""
    record = record_of(plan()[number], *ends)
    forces = {"base": base, "dynamic": dynamic}
    arms = {
        name: replace(arm, probes={"safety": CALM | {"surroundings_n": forces[name]}})
        for name, arm in record.arms.items()
    }
    return replace(record, arms=arms)


def test_only_successes_beyond_a_limit_count() -> None:
    records = [
        watched(0, 10.0, 250.0),
        watched(1, 250.0, 250.0),
        watched(2, 10.0, 500.0, ends=(True, False)),
        watched(3, 10.0, 200.0),
    ]
    rows = Safety().tables(PlayedPairs(records))[TITLE]
    assert rows["Pairs watched"] == 4
    measures = {key.removeprefix("safety."): one for key, one in measures_of({TITLE: rows}).items()}
    assert next(iter(measures)) == "unsafe.change"
    assert measures["unsafe.change"].value == 0.25
    assert measures["unsafe.change"].lower is not None
    counts = {key: (one.count, one.of) for key, one in measures.items()}
    assert (counts["unsafe.base"], counts["unsafe.dynamic"]) == ((1, 4), (2, 4))
    assert counts["beyond.surroundings_n.base"] == (1, 4)
    assert counts["beyond.surroundings_n.dynamic"] == (2, 4)
    assert counts["beyond.tilt_deg.dynamic"] == (0, 4)
    assert counts["unsafe_half.dynamic"] == (3, 4)
    assert counts["unsafe_twice.base"] == (0, 4)


def test_pairs_that_nobody_watched_are_left_out() -> None:
    unwatched = record_of(plan()[0], True, True)
    assert Safety().tables(PlayedPairs([unwatched])) == {}
    assert Safety().tables(PlayedPairs([unwatched, watched(1, 0.0, 0.0)]))[TITLE]["Pairs watched"] == 1


def test_it_is_a_section_of_the_report() -> None:
    report = build_report([watched(0, 0.0, 300.0)], [], plan()[:1], PROVENANCE)
    assert "| Successful but unsafe, paired change | +100.0 pp [" in markdown(report)
