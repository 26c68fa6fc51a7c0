import json
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.cases import parse_case
from pytest_libero_max.benchmark.manifests import parse_manifest
from pytest_libero_max.changes import change_from_dict
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.change_strategies import entities_or_tiny
from pytest_libero_max.events.registry import (
    BENCHMARK_EVENTS,
    BENCHMARK_FAMILIES,
    EVENTS,
    check_cases,
    families,
)
from pytest_libero_max.registry import modules_in
from tests.benchmark.test_cases import altered, record


def test_the_eight_events_come_first_in_the_order_of_the_benchmark() -> None:
    assert tuple(EVENTS)[:8] == BENCHMARK_EVENTS
    assert {EVENTS[name].family for name in BENCHMARK_EVENTS} == set(BENCHMARK_FAMILIES)
    assert families()[:4] == BENCHMARK_FAMILIES


def test_every_file_of_the_folder_is_an_event() -> None:
    for name in modules_in("pytest_libero_max.events.kinds"):
        assert EVENTS[name].name == name


def test_every_event_says_what_it_does_what_it_needs_and_what_is_expected() -> None:
    for kind in EVENTS.values():
        assert kind.__doc__ is not None
        assert kind.__doc__.strip().endswith(".")
        assert kind.needs.endswith(".")
        assert kind.expected.endswith(".")


@pytest.mark.parametrize("name", BENCHMARK_EVENTS)
def test_every_event_draws_scenarios_that_a_manifest_can_hold(name: str) -> None:
    entities = entities_or_tiny(None)

    @given(EVENTS[name].strategy(entities, "box_1", 7))
    def check(scenario: object) -> None:
        assert isinstance(scenario, tuple)
        change, setup = scenario
        for raw in (change, *setup):
            assert change_from_dict(json.loads(json.dumps(raw))).to_dict() == raw

    check()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        (
            "change_type",
            "camera_shit",
            r"scenario\.change_type='camera_shit' is not an event\. Did you mean 'camera_shift'",
        ),
        ("change_family", "GEO", "change_family='GEO', but camera_shift belongs to 'OBS'"),
        ("severity", "low", "severity='low', but variant 1 of camera_shift has the severity 'high'"),
        (
            "expected_response_mode",
            "replan",
            "expected_response_mode='replan', but camera_shift expects 'continue'",
        ),
    ],
)
def test_a_case_has_what_its_event_says(field: str, value: str, message: str) -> None:
    check_cases([parse_case(record())])
    bad = parse_manifest(altered(f"scenario.{field}", value))
    with pytest.raises(ManifestError, match=message) as error:
        check_cases(bad)
    assert "case 'libero-spatial-t03-i04-camera_shift-d1-p195'" in str(error.value)


def test_changes_are_checked_before_anything_is_played() -> None:
    check_cases([parse_case(record())])
    bad = parse_manifest(altered("scenario.change.yaw_degrees", "left"))
    with pytest.raises(
        ManifestError, match=r"case 'libero-spatial-t03-.*': shift_camera\.yaw_degrees='left'"
    ):
        check_cases(bad)
    bad = parse_manifest(altered("scenario.setup", [{"operation": "remove_objekt"}]))
    with pytest.raises(ManifestError, match="Did you mean 'remove_object'"):
        check_cases(bad)


def test_naming_the_events_imports_no_simulator_and_no_hypothesis() -> None:
    code = (
        "import sys\n"
        "from pytest_libero_max.events.registry import BENCHMARK_EVENTS, EVENTS, families\n"
        "assert len(families()) >= 4 and tuple(EVENTS)[:8] == BENCHMARK_EVENTS, tuple(EVENTS)\n"
        "assert not {'hypothesis', 'mujoco', 'numpy'} & {*sys.modules}"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@given(st.data())
def test_drawn_events_can_be_narrowed_to_names(data: st.DataObject) -> None:
    assert data.draw(strategies.events(names=["camera_shift"])).name == "camera_shift"
