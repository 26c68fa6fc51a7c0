"""The probe of stages: what it says of known rollouts, and that no proof depends on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.pairing.probes.probe import Probes
from pytest_libero_max.pairing.probes.standard import STANDARD
from pytest_libero_max.pairing.runner import Pair, PairSettings, measure_pair
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.short_episodes import shorten_here

from .actors import Approaching
from .actors import make_case as tiny_case


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


def played(case: Case, substrate: EmbeddedSubstrate, name: str, settings: PairSettings) -> Pair:
    policy = load_policy(name)
    policy.spec = replace(policy.spec, cameras=())
    return measure_pair(case, substrate.world(case), policy, settings)


def without_probes(pair: Pair) -> dict[str, Any]:
    identity = pair.record.identity()
    for arm in identity["arms"].values():
        arm.pop("probes", None)
    return identity


TASKS = [
    ("libero_spatial", 0, "target_relocation"),
    ("libero_goal", 0, "illumination_switch"),
]


@pytest.mark.parametrize(("suite", "task", "event"), TASKS)
def test_a_pair_is_the_same_with_and_without_it_forked_and_replayed(
    suite: str, task: int, event: str, substrate: EmbeddedSubstrate, monkeypatch: pytest.MonkeyPatch
) -> None:
    shorten_here(monkeypatch, 110)  # the event, its answer, and a grasp
    case = make_case(event, suite, task)
    without = Probes(tuple(probe for probe in STANDARD.standard if probe.name != "stages"))
    plain = played(case, substrate, "expert", PairSettings(probes=without))
    fork, replay = (played(case, substrate, "expert", PairSettings(mode)) for mode in ("fork", "replay"))
    assert without_probes(plain) == without_probes(fork) == without_probes(replay)
    assert fork.record.identity() == replay.record.identity()
    assert fork.record.trigger_step is not None
    assert "stages" not in plain.record.arms["base"].probes


def stages(pair: Pair, arm: str) -> dict[str, Any]:
    found: dict[str, Any] = pair.record.arms[arm].probes["stages"]
    return found


def test_it_follows_an_object_from_approach_to_goal_and_an_approach_begins_anew_at_a_change(
    substrate: EmbeddedSubstrate,
) -> None:
    case = make_case("target_relocation", "libero_spatial", 0, variant=1)
    pair = played(case, substrate, "expert", PairSettings())
    base, dynamic = stages(pair, "base"), stages(pair, "dynamic")
    for seen, arm in ((base, "base"), (dynamic, "dynamic")):
        assert seen["goal"] == ["on akita_black_bowl_1 plate_1"]
        assert seen["satisfied"] == [True]
        order = [
            seen[f"{name}_step"][0] for name in ("close", "touch", "grasp", "lift", "above", "satisfied")
        ]
        assert order == sorted(order)
        assert order[-1] == pair.record.arms[arm].steps
        assert seen["away_m"][0] < 0.03
        assert seen["moved"] == seen["wrong"] == seen["toppled"] == []
    event = pair.record.trigger_step
    assert event is not None
    assert base["close_old_m"] == [None]
    assert dynamic["close_step"][0] > event
    assert dynamic["close_old_m"][0] > dynamic["close_m"][0] + 0.05


def test_each_fact_of_a_goal_has_its_own_stages(substrate: EmbeddedSubstrate) -> None:
    case = make_case("camera_shift", "libero_10", 0)
    seen = stages(played(case, substrate, "expert", PairSettings()), "base")
    assert seen["entity"] == ["alphabet_soup_1", "tomato_sauce_1"]
    first, second = seen["satisfied_step"]
    assert first != second
    assert seen["lost_open"][seen["satisfied_step"].index(min(first, second))] is True


def test_a_drawer_has_a_way_and_no_grasp_and_no_destination(substrate: EmbeddedSubstrate) -> None:
    case = make_case("camera_shift", "libero_goal", 0)
    seen = stages(played(case, substrate, "expert", PairSettings()), "base")
    assert seen["goal"] == ["open wooden_cabinet_1_middle_region"]
    assert seen["travel_m"][0] > 0.1
    assert seen["travel_rad"] == seen["away_m"] == seen["lift_step"] == [None]
    assert seen["closest_m"][0] < 0.01


def test_a_hand_that_holds_still_and_one_that_is_held_up_are_told_apart(substrate: EmbeddedSubstrate) -> None:
    case = make_case("camera_shift", "libero_spatial", 0)
    seen = stages(played(case, substrate, "noop", PairSettings()), "base")
    assert seen["reach_m"] < 0.01
    assert (seen["still_step"], seen["blocked_steps"]) == (0, 0)
    assert seen["repeated_queries"] == 21
    assert seen["closest_m"][0] > 0.3


def test_a_world_that_does_not_tell_its_goal_is_followed_by_the_trigger_entity() -> None:
    world = TinyWorld()
    pair = measure_pair(tiny_case("target_relocation"), world, Approaching(wait=2, horizon=5, interval=4))
    seen = stages(pair, "dynamic")
    assert seen["goal"] == seen["entity"] == ["box_1"]
    assert seen["closest_m"][0] >= round(pair.record.arms["dynamic"].min_distance_m, 4)
    assert seen["away_m"] == [None]
    world.close()
