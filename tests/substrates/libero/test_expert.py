"""The scripted expert, which knows worlds through their contract alone, on genuine scenes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_libero_max.benchmark.cases import parse_case
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.errors import AdapterError
from pytest_libero_max.events.registry import resolve_event
from pytest_libero_max.experts import articulation
from pytest_libero_max.experts.scene_view import read_hand
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.tasks.contents import task_metadata
from tests.substrates.libero.data import needs_package

pytestmark = needs_package


@pytest.mark.parametrize(
    ("suite", "task", "init", "event"),
    [
        ("libero_spatial", 4, 5, "illumination_switch"),  # out of a drawer
        ("libero_spatial", 9, 1, "receptacle_relocation"),  # from the top of the cabinet
        ("libero_object", 2, 3, "target_relocation"),
        ("libero_goal", 0, 0, "camera_shift"),  # by the handle of a drawer
        ("libero_goal", 7, 0, "camera_shift"),  # by a knob
        ("libero_10", 2, 0, "camera_shift"),  # a pot by its lid
        ("libero_10", 9, 0, "camera_shift"),  # a mug by its handle, into the microwave
    ],
)
def test_the_expert_solves_genuine_tasks_and_finds_its_way_after_events(
    substrate: LiberoSubstrate, suite: str, task: int, init: int, event: str
) -> None:
    metadata, identity = task_metadata(suite, task), Identity("libero", suite, task, init)
    resolved = resolve_event(event, 0, metadata, identity)
    case = parse_case(case_record(identity, resolved, metadata.name))
    policy = load_policy("expert")
    policy.spec = replace(policy.spec, cameras=())
    record = play_pair(case, substrate.world(case), policy)
    assert record.outcome == "preserved_success"
    assert record.triggered


def test_a_part_that_the_scene_does_not_tell_of_is_named(
    substrate: LiberoSubstrate, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = substrate.task_world("libero_goal", 7, 195)
    monkeypatch.setattr(world, "graspable_parts", {})
    with pytest.raises(AdapterError, match="cannot move joint='flat_stove_1_button'"):
        articulation.articulate(world, world.goal[0], read_hand(world))
