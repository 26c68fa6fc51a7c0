from collections import Counter
from dataclasses import replace

import pytest

from pytest_libero_max.benchmark.certificates import read_certificates
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.benchmark.tracks import FOLDER, load_track
from pytest_libero_max.changes import change_from_dict
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, resolve_event
from pytest_libero_max.makers.construction.examiner import certify
from pytest_libero_max.makers.construction.original import build_original
from pytest_libero_max.makers.construction.preflight import preflight
from pytest_libero_max.makers.construction.release import read_rejected
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.tasks.contents import task_metadata


@pytest.fixture(scope="module")
def original() -> Manifest:
    return load_track("original")


def test_every_event_and_variant_occurs_twice(original: Manifest) -> None:
    assert len(original) == 32
    cells = Counter((case.event.name, case.event.variant) for case in original)
    assert cells == {(event, variant): 2 for event in BENCHMARK_EVENTS for variant in (0, 1)}


def test_each_suite_hosts_every_event_it_can(original: Manifest) -> None:
    for event in BENCHMARK_EVENTS:
        suites = sorted(case.suite for case in original if case.event.name == event)
        if event == "distractor_burst":
            assert suites == ["libero_object"] * 4
        else:
            assert suites == ["libero_object"] * 2 + ["libero_spatial"] * 2


def test_tasks_and_initial_states_are_spread(original: Manifest) -> None:
    tasks = Counter((case.suite, case.task_index) for case in original)
    assert len(tasks) >= 18
    assert max(tasks.values()) <= 3
    inits = Counter(case.init_state_index for case in original)
    assert set(inits) == set(range(10))


def test_cases_are_sorted_and_of_unmodified_tasks(original: Manifest) -> None:
    ids = [case.case_id for case in original]
    assert ids == sorted(ids)
    assert {case.source for case in original} == {"libero"}
    assert {case.policy_seed for case in original} == {195}


def test_every_case_follows_from_its_identity(original: Manifest) -> None:
    for case in original:
        identity = Identity("libero", case.suite, case.task_index, case.init_state_index)
        task = task_metadata(case.suite, case.task_index)
        event = resolve_event(case.event.name, case.event.variant, task, identity)
        assert case_record(identity, event, task.name) == case.record


def test_every_change_can_be_built(original: Manifest) -> None:
    for case in original:
        for raw in (case.event.change, *case.event.setup):
            assert change_from_dict(raw).to_dict() == raw


def test_rebuilding_gives_the_same_track(original: Manifest) -> None:
    assert build_original(read_rejected(FOLDER)) == original


def test_a_rejected_configuration_is_replaced_within_its_cell(original: Manifest) -> None:
    ledger = read_rejected(FOLDER)
    first = original.cases[0]
    replaced = build_original({*ledger, first.case_id})
    assert first.case_id not in {case.case_id for case in replaced}
    cells = Counter((case.event.name, case.event.variant, case.suite) for case in replaced)
    assert cells == Counter((case.event.name, case.event.variant, case.suite) for case in original)


def test_a_cell_without_configurations_is_an_error() -> None:
    everything = {
        Identity("libero", "libero_spatial", index, init).case_id("camera_shift", 0)
        for index in range(10)
        for init in range(10)
    }
    with pytest.raises(ManifestError, match=r"camera_shift, variant 0: .* libero_spatial"):
        build_original(everything)


def test_events_pass_the_preflight_and_are_solved_as_certified(original: Manifest) -> None:
    expert = load_policy("expert")
    expert.spec = replace(expert.spec, cameras=())
    substrate = open_substrate("embedded")
    certificates = read_certificates(FOLDER)
    of_each_event = {case.event.name: case for case in original}
    for case in map(of_each_event.get, ("target_relocation", "obstacle_insertion", "sensor_noise_onset")):
        assert case is not None
        assert preflight(substrate.world(case), case).passed
        assert certify(substrate.world(case), case, expert) == certificates[case.case_id]
    substrate.close()
