"""Repeats of a case, played on the tiny world."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.schedules import Arm, arms_of
from pytest_libero_max.lab.studies.repeats import Repeats
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.policies.contract import Query, query_seed
from pytest_libero_max.studies.registry import study_from_dict
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Observation
from tests.pairing.actors import Approaching, make_case


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def all_arms(study: Repeats, policy: Approaching) -> tuple[Arm, ...]:
    case = make_case(distance_m=0.25)
    return (*arms_of(case), *study.arms(case, policy.spec))


class Seeded(Approaching):
    """Moves a little to a side that its seed says, and keeps the seeds."""

    def __init__(self) -> None:
        super().__init__(wait=2, horizon=8, interval=4)
        self.seeds: list[int] = []

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        self.seeds.append(query.seed)
        actions = super().predict(observation, query)
        actions[:, 0] += 0.01 * np.random.default_rng(query.seed).random()
        return actions


def test_repeats_are_pairs_with_seeds_of_their_own(world: TinyWorld) -> None:
    case, policy = make_case(distance_m=0.25), Seeded()
    plain = measure_pair(case, world, Seeded()).record
    studied = measure_pair(case, world, policy, arms=all_arms(Repeats(), policy)).record
    arms = studied.arms
    assert [*arms] == ["base", "dynamic", "base_2", "dynamic_2", "base_3", "dynamic_3"]
    assert {name: arms[name].proof for name in plain.arms} == {
        name: arm.proof for name, arm in plain.arms.items()
    }
    assert len({arm.proof for arm in arms.values()}) == 6
    firsts = {query_seed(case.policy_seed, 0, plays) for plays in range(3)}
    assert len(firsts) == 3
    assert firsts <= set(policy.seeds)
    for play in (2, 3):
        shared = arms[f"dynamic_{play}"].firings
        assert [len(shared), len(arms[f"base_{play}"].firings)] == [play, play - 1]
        assert shared[-1].step > 0


def test_the_number_of_repeats_can_be_chosen(world: TinyWorld) -> None:
    case, policy = make_case(distance_m=0.25), Seeded()
    two, three = (all_arms(Repeats(plays), policy) for plays in (2, 3))
    assert [arm.name for arm in Repeats(4).arms(case, policy.spec)][-2:] == ["base_4", "dynamic_4"]
    arms = measure_pair(case, world, policy, arms=two).record.arms
    assert [*arms] == ["base", "dynamic", "base_2", "dynamic_2"]
    of_three = measure_pair(case, world, Seeded(), arms=three).record.arms
    assert {name: arm.proof for name, arm in arms.items()} == {name: of_three[name].proof for name in arms}


def test_a_policy_without_chance_repeats_itself(world: TinyWorld) -> None:
    case, policy = make_case(distance_m=0.25), Approaching(wait=2)
    arms = measure_pair(case, world, policy, arms=all_arms(Repeats(), policy)).record.arms
    assert {arms[f"base_{play}"].proof for play in (2, 3)} == {arms["base"].proof}
    assert {arms[f"dynamic_{play}"].proof for play in (2, 3)} == {arms["dynamic"].proof}


def test_its_number_of_plays_is_read_from_the_header_of_a_run_and_checked() -> None:
    assert study_from_dict(Repeats(5).to_dict()).to_dict() == {"name": "repeats", "settings": "5"}
    with pytest.raises(OptionError, match=r"repeats.*at least 2"):
        Repeats.of("1")
