from collections import Counter
from dataclasses import replace

import pytest

from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.benchmark.tracks import FOLDER, load_track
from pytest_libero_max.changes import change_from_dict
from pytest_libero_max.construction.examination import examine
from pytest_libero_max.construction.release import read_certificates, read_rejected
from pytest_libero_max.construction.smoke import build_smoke
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, resolve_event
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.sources import open_substrate
from pytest_libero_max.sources.metadata import task_metadata


@pytest.fixture(scope="module")
def smoke() -> Manifest:
    return load_track("smoke")


def test_every_event_and_variant_occurs_twice(smoke: Manifest) -> None:
    assert len(smoke) == 32
    cells = Counter((case.event.name, case.event.variant) for case in smoke)
    assert cells == {(event, variant): 2 for event in BENCHMARK_EVENTS for variant in (0, 1)}


def test_each_suite_hosts_every_event_it_can(smoke: Manifest) -> None:
    for event in BENCHMARK_EVENTS:
        suites = sorted(case.suite for case in smoke if case.event.name == event)
        if event == "distractor_burst":
            assert suites == ["libero_object"] * 4
        else:
            assert suites == ["libero_object"] * 2 + ["libero_spatial"] * 2


def test_tasks_and_initial_states_are_spread(smoke: Manifest) -> None:
    tasks = Counter((case.suite, case.task_index) for case in smoke)
    assert len(tasks) >= 18
    assert max(tasks.values()) <= 3
    inits = Counter(case.init_state_index for case in smoke)
    assert set(inits) == set(range(10))


def test_cases_are_sorted_and_of_unmodified_tasks(smoke: Manifest) -> None:
    ids = [case.case_id for case in smoke]
    assert ids == sorted(ids)
    assert {case.source for case in smoke} == {"libero"}
    assert {case.policy_seed for case in smoke} == {195}


def test_every_case_follows_from_its_identity(smoke: Manifest) -> None:
    for case in smoke:
        identity = Identity("libero", case.suite, case.task_index, case.init_state_index)
        task = task_metadata(case.suite, case.task_index)
        event = resolve_event(case.event.name, case.event.variant, task, identity)
        assert case_record(identity, event, task.name) == case.record


def test_every_change_can_be_built(smoke: Manifest) -> None:
    for case in smoke:
        for raw in (case.event.change, *case.event.setup):
            assert change_from_dict(raw).to_dict() == raw


def test_rebuilding_gives_the_same_track(smoke: Manifest) -> None:
    assert build_smoke(read_rejected(FOLDER)) == smoke


def test_a_rejected_configuration_is_replaced_within_its_cell(smoke: Manifest) -> None:
    ledger = read_rejected(FOLDER)
    first = smoke.cases[0]
    replaced = build_smoke({*ledger, first.case_id})
    assert first.case_id not in {case.case_id for case in replaced}
    cells = Counter((case.event.name, case.event.variant, case.suite) for case in replaced)
    assert cells == Counter((case.event.name, case.event.variant, case.suite) for case in smoke)


def test_a_cell_without_configurations_is_an_error() -> None:
    everything = {
        Identity("libero", "libero_spatial", index, init).case_id("camera_shift", 0)
        for index in range(10)
        for init in range(10)
    }
    with pytest.raises(ManifestError, match="camera_shift, variant 0: every configuration of libero_spatial"):
        build_smoke(everything)


def test_every_case_passes_the_preflight_and_is_solved_as_certified(smoke: Manifest) -> None:
    expert = load_policy("expert")
    expert.spec = replace(expert.spec, cameras=())
    substrate = open_substrate("embedded")
    certificates = read_certificates(FOLDER)
    for case in smoke:
        examination = examine(substrate.world(case), case, expert)
        assert examination.problems == ()
        assert examination.certificate == certificates[case.case_id]
    substrate.close()
