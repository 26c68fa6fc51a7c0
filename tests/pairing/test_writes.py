"""A privileged policy that writes to the world: found, named, and without effect on the next pair."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.pairing.runner import PairSettings, play_pair
from pytest_libero_max.policies.contract import Episode, Query
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import OnMujoco

from .actors import Approaching, make_case

Write = Callable[[OnMujoco], None]


class Writing(Approaching):
    """Writes to the world at its third query."""

    def __init__(self, write: Write) -> None:
        super().__init__(privileged=True)
        self.write = write

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        assert isinstance(episode.world, OnMujoco)
        self.world = episode.world

    def predict(self, observation: Any, query: Query) -> Any:
        if query.index == 3:
            self.write(self.world)
        return super().predict(observation, query)


def gravity(world: OnMujoco) -> None:
    world.model.opt.gravity[2] = -1.0


def friction(world: OnMujoco) -> None:
    world.model.geom_friction[:, 0] = 0.0


def size(world: OnMujoco) -> None:
    world.model.geom_size[-1] *= 2.0


def timestep(world: OnMujoco) -> None:
    world.model.opt.timestep = 0.004


def mass(world: OnMujoco) -> None:
    world.model.body_mass[:] *= 2.0


def light(world: OnMujoco) -> None:
    world.model.light_diffuse[:] = 0.0


def pose(world: OnMujoco) -> None:
    world.data.qpos[0] += 1e-9


def played(world: OnMujoco, mode: str = "fork") -> str:
    settings = PairSettings(mode)  # type: ignore[arg-type]
    record = play_pair(make_case(), world, Approaching(privileged=True), settings).to_dict()
    return json.dumps({**record, "timings": None}, sort_keys=True)


@pytest.mark.parametrize("mode", ["fork", "replay"])
@pytest.mark.parametrize(
    ("write", "named"),
    [
        (gravity, r"wrote opt\.gravity of the world's model"),
        (friction, r"wrote geom_friction of the world's model"),
        (size, r"wrote geom_size of the world's model"),
        (timestep, r"wrote opt\.timestep of the world's model"),
        (mass, r"wrote body_mass of the world's model"),
        (light, r"altered the world in predict, query 3 .* What differs: light_diffuse\."),
        (pose, r"altered the world in predict, query 3 .* What differs: physics\."),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_write_is_found_and_named_and_the_next_pair_is_what_it_was(
    write: Write, named: str, mode: str
) -> None:
    world = TinyWorld()
    baseline = played(world, mode)
    with pytest.raises(AdapterError, match=named):
        play_pair(make_case(), world, Writing(write), PairSettings(mode))  # type: ignore[arg-type]
    assert played(world, mode) == baseline
    world.close()


def test_a_write_is_named_where_another_error_comes_first() -> None:
    def destroy(world: OnMujoco) -> None:
        world.model.opt.gravity[2] = float("nan")

    world = TinyWorld()
    baseline = played(world)
    with pytest.raises(AdapterError, match=r"wrote opt\.gravity"):
        play_pair(make_case(), world, Writing(destroy))
    assert played(world) == baseline
    world.close()


def test_an_interrupt_leaves_the_scene_as_it_was_built() -> None:
    def interrupt(world: OnMujoco) -> None:
        gravity(world)
        raise KeyboardInterrupt

    world = TinyWorld()
    with pytest.raises(KeyboardInterrupt):
        play_pair(make_case(), world, Writing(interrupt))
    assert world.model.opt.gravity[2] == pytest.approx(-9.81)
    world.close()
