"""The pair runner on a scene with a robot; the tiny world stands in for it everywhere else."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.events.registry import check_cases
from pytest_libero_max.pairing.prefix import PrefixMode
from pytest_libero_max.pairing.probes.registry import probes_called
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate

from .actors import make_case


@pytest.mark.parametrize("event", ["camera_shift", "sensor_noise_onset"])
def test_fork_and_replay_measure_the_same_pair_with_images_at_every_query(event: str) -> None:
    case = make_case(event, distance_m=0.35, suite="libero_object")
    trigger = {**case.event.trigger, "value": "alphabet_soup_1"}
    case = replace(case, event=replace(case.event, trigger=trigger))
    policy = load_policy("random")
    policy.spec = replace(policy.spec, image_size=64)
    substrate = EmbeddedSubstrate()
    world = substrate.world(case)
    fork, replay = (measure_pair(case, world, policy, PairSettings(mode)) for mode in ("fork", "replay"))
    substrate.close()
    assert fork.record.identity() == replay.record.identity()
    assert fork.record.trigger_step is not None
    assert fork.record.evidence is not None
    assert fork.record.evidence["pixel_change"]["agentview"] > 1.0
    assert fork.dynamic is not None
    # The policy ignores what it sees and both events leave the physics alone: only the proof may differ.
    assert np.array_equal(fork.dynamic.end_effector, fork.base.end_effector)
    assert fork.record.dynamic_digest != fork.record.base_digest


NAMED = {"event": "value"}
"""The entity that the event's own trigger names."""

SWITCH: Json = {
    "operation": "set_task",
    "instruction": "pick up the tomato sauce and place it in the basket",
    "goal": [["in", "tomato_sauce_1", "basket_1_contain_region"]],
}
REWORD = {"operation": "set_instruction", "instruction": "leave it"}


def entry(trigger: Any, change: Any = "event", **more: Any) -> Json:
    return {"trigger": trigger, "change": change, **more}


def after(steps: int, entry: int = -1) -> Json:
    return {"type": "steps_after", "steps": steps, "entry": entry}


DYNAMIC = {
    "a trigger at the start": [entry({"type": "at_start"})],
    "a trigger of another distance": [entry({"type": "on_proximity", "value": NAMED, "distance_m": 0.1})],
    "a trigger after a grasp": [entry({"type": "after_grasp", "value": NAMED})],
    "a trigger above a receptacle": [entry({"type": "above", "value": "basket_1"})],
    "a trigger at a share of the budget": [entry({"type": "budget_fraction", "value": 0.1})],
    "an event that ends after five steps": [
        entry("event"),
        {"trigger": after(5), "reverts": 0},
    ],
    "several entries": [
        entry("event", strength=0.5),
        entry(after(2), {"operation": "set_lighting", "scale": 0.5}),
        {"trigger": after(3, 0), "reverts": 0},
        entry(after(1), "event"),
        {"trigger": after(4, 1), "reverts": 1},
    ],
    "another instruction": [entry("event", REWORD), {"trigger": after(5), "reverts": 0}],
    "another goal": [entry("event", SWITCH)],
}
STEPS: dict[str, Callable[[int, int], list[int]]] = {
    "a trigger at the start": lambda event, budget: [0],
    "a trigger at a share of the budget": lambda event, budget: [math.ceil(0.1 * budget)],
    "an event that ends after five steps": lambda event, budget: [event, event + 5],
    "several entries": lambda event, budget: [event, event + 2, event + 3, event + 4, event + 6],
    "another instruction": lambda event, budget: [event, event + 5],
    "another goal": lambda event, budget: [event],
}
"""Steps at which the entries happen, where they follow from that of the event or the budget."""


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    opened = EmbeddedSubstrate()
    yield opened
    opened.close()


def play(case: Case, substrate: EmbeddedSubstrate, mode: PrefixMode = "fork") -> PairRecord:
    expert = load_policy("expert")
    expert.spec = replace(expert.spec, cameras=())
    return measure_pair(case, substrate.world(case), expert, PairSettings(mode)).record


@pytest.fixture(scope="module")
def plain(substrate: EmbeddedSubstrate) -> PairRecord:
    """The case of the manifests here without a program."""
    return play(the_case(), substrate)


def the_case() -> Case:
    """A camera's shift in LIBERO-Object."""
    cases = load_track("original").cases
    return next(case for case in cases if (case.suite, case.event.name) == ("libero_object", "camera_shift"))


def loaded(folder: Path, arms: list[Json]) -> Case:
    """The case with a program, as a manifest in a file spells it."""
    manifest = {
        "benchmark_id": "programs",
        "benchmark_version": "1.0.0",
        "protocol": load_track("original").protocol,
        "manifest_format": 2,
        "cases": [{**the_case().record, "program": {"name": "tried", "arms": arms}}],
    }
    path = folder / "manifest.json"
    path.write_text(json.dumps(manifest))
    (case,) = load_manifest(path)
    check_cases([case])
    return case


@pytest.fixture(scope="module")
def record(substrate: EmbeddedSubstrate, tmp_path_factory: pytest.TempPathFactory) -> PairRecord:
    """The case with an arm for each of the schedules, which share Base and the executed prefix."""
    arms: list[Json] = [{"name": arm_of(what), "schedule": schedule} for what, schedule in DYNAMIC.items()]
    return play(loaded(tmp_path_factory.mktemp("programs"), arms), substrate)


def arm_of(what: str) -> str:
    return what.replace(" ", "_")


@pytest.mark.parametrize("what", DYNAMIC)
def test_a_manifest_plays_every_trigger_reversal_instruction_and_goal(
    record: PairRecord, plain: PairRecord, what: str
) -> None:
    event, arm = plain.trigger, record.arms[arm_of(what)]
    assert event is not None
    steps = [firing.step for firing in arm.firings]
    assert len(steps) == len(DYNAMIC[what])
    if what in STEPS:
        assert steps == STEPS[what](event.step, record.max_steps)
    else:  # nearer to the target, or later in the task
        assert steps[0] > event.step
    assert record.arms["base"] == plain.arms["base"]
    assert arm.proof != record.arms["base"].proof
    if what == "another goal":
        assert arm.firings[0].evidence["after"]["goal"] == SWITCH["goal"]
        assert not arm.success or arm.steps != record.base_steps


def test_several_entries_are_replayed_as_they_were_forked(
    record: PairRecord, tmp_path: Path, substrate: EmbeddedSubstrate
) -> None:
    what = "several entries"
    case = loaded(tmp_path, [{"name": "dynamic", "schedule": DYNAMIC[what]}])
    assert play(case, substrate, "replay").arms["dynamic"] == record.arms[arm_of(what)]


def test_a_manifest_plays_more_arms_of_other_cadences_and_repetitions(
    tmp_path: Path, substrate: EmbeddedSubstrate, plain: PairRecord
) -> None:
    reset = entry({"type": "at_start"})
    case = loaded(
        tmp_path,
        [
            {"name": "reset", "schedule": [reset]},
            {"name": "reset_again", "schedule": [reset], "repetition": 1},
            {"name": "base_q4", "cadence": {"query_interval": 4, "horizon": 8}},
        ],
    )
    arms = play(case, substrate).arms
    assert list(arms) == ["base", "dynamic", "reset", "reset_again", "base_q4"]
    assert arms["reset"].firings[0].step == 0
    assert (arms["reset_again"].proof, arms["reset_again"].shares) == (arms["reset"].proof, None)
    assert arms["base_q4"].queries == -(-arms["base_q4"].steps // 4)
    assert {name: arms[name] for name in plain.arms} == plain.arms


def test_a_switch_of_the_goal_is_scored_by_the_new_goal_and_by_the_first(
    tmp_path: Path, substrate: EmbeddedSubstrate
) -> None:
    case = loaded(tmp_path, [{"name": "dynamic", "schedule": [entry("event", SWITCH)]}])
    settings = PairSettings(probes=probes_called(["first_goal"]))
    expert = load_policy("expert")
    expert.spec = replace(expert.spec, cameras=())
    arms = measure_pair(case, substrate.world(case), expert, settings).record.arms
    seen = {name: arm.probes["first_goal"] for name, arm in arms.items()}
    assert seen["base"]["goal"] == seen["dynamic"]["goal"] != [" ".join(SWITCH["goal"][0])]
    assert {name: (arm.success, seen[name]["held"]) for name, arm in arms.items()} == {
        "base": (True, True),
        "dynamic": (True, False),
    }
