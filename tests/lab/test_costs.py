from __future__ import annotations

from pytest_libero_max.lab.costs import CostModel, Kind, counted, seconds_of
from pytest_libero_max.pairing.record import PairRecord
from tests.report.made_up import NEVER_TRIGGERED, plan, record_of

PAIR = plan()[0]
TIMINGS = {
    "pair_s": 10.0,
    "world_s": 1.0,
    "reset_s": 0.5,
    "observe_s": 3.2,
    "policy_s": 1.6,
    "arm_base_s": 6.0,
}


def _record(**changes: object) -> PairRecord:
    return record_of(PAIR, True, True, **{"timings": TIMINGS, **changes})


def _kind(suite: str = "libero_goal", task: int = 0, event: str = "camera_shift") -> Kind:
    return Kind(suite, f"{suite}/{task}", event)


def test_what_arms_share_is_counted_once() -> None:
    record = _record()  # Dynamic went on from step 23 to 95; each arm was asked 18 and 14 times
    assert counted(record) == (90 + 95 - 23, 18 + 14)
    asked = _record(timings={**TIMINGS, "asked_again_s": 0.2})
    assert counted(asked) == (162, 34)
    assert counted(_record(**NEVER_TRIGGERED)).steps == 90


def test_an_older_record_takes_what_its_parts_took() -> None:
    parts = {"reset_s": 1.0, "arm_base_s": 4.0, "arm_dynamic_s": 2.0, "prefix_s": 0.5, "observe_s": 3.0}
    assert seconds_of(_record(timings=parts)) == 7.5
    assert seconds_of(_record()) == 10.0
    assert seconds_of(_record(timings={})) == 0.0


def test_a_case_that_was_measured_costs_what_it_did() -> None:
    model = CostModel()
    for number in range(4):
        model.add(
            _kind(), _record(case_id=f"case-{number}", base_queries=20 + number, base_steps=100 + number)
        )
    assert [model.drawn(_kind(), f"case-{number}").calls for number in range(4)] == [34, 35, 36, 37]
    others = [model.drawn(_kind(), f"other-{number}").calls for number in range(40)]
    assert set(others) == {34, 35, 36, 37}
    assert others == [model.drawn(_kind(), f"other-{number}").calls for number in range(40)]


def test_too_few_pairs_of_a_task_are_not_drawn_from_alone() -> None:
    model = CostModel()
    for number, task in enumerate((0, 1, 1)):
        model.add(_kind(task=task), _record(case_id=f"case-{number}", base_queries=20 + number))
    drawn = {model.drawn(_kind(task=0), f"other-{number}").calls for number in range(40)}
    assert drawn == {34, 35, 36}
