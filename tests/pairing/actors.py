"""Cases, worlds and policies whose every move is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.changes import MoveObject, SetSensorCorruption, ShiftCamera
from pytest_libero_max.events.kind import Scenario
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.triggers import Proximity
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import ImageSize, Observation
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION

BUDGET = 24
"""Policy steps of an episode here: everything that these tests want to see happens before."""

CHANGES = {
    "camera_shift": ShiftCamera("agentview", (0.1, 0.0, 0.0), 5.0, 0.0),
    "sensor_noise_onset": SetSensorCorruption(24.0, 0.08, 7),
    "target_relocation": MoveObject("box_1", (0.05, 0.0, 0.0)),
}
DOWN = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0)


class ShortCase(Case):
    """A case with a short budget."""

    @property
    def budget(self) -> int:
        return BUDGET


def shorten(case: Case) -> ShortCase:
    """The same case with less budget."""
    return ShortCase(**{field.name: getattr(case, field.name) for field in fields(case)})


def make_case(event: str = "camera_shift", distance_m: float = 0.18, **changes: Any) -> ShortCase:
    """A case of the tiny world: ``box_1`` is the trigger entity, the budget is ``BUDGET``."""
    case = ShortCase(
        case_id=f"case-{event}",
        suite="libero_spatial",
        task_index=0,
        init_state_index=3,
        policy_seed=195,
        event=EVENTS[event].event(0, 7, Scenario(CHANGES[event].to_dict()), Proximity("box_1", distance_m)),
        source="libero",
        source_category="Unmodified",
        difficulty=None,
        instruction=None,
        record={"case_id": f"case-{event}"},
    )
    return replace(case, **changes)


class Approaching:
    """Holds still for ``wait`` steps, then heads for ``box_1``, as a function of the step alone.

    Records every query with the agent view it was shown, and every episode.
    """

    def __init__(
        self,
        wait: int = 0,
        horizon: int = 1,
        interval: int = 1,
        cameras: Sequence[str] = (),
        privileged: bool = False,
        length: int | None = None,
    ) -> None:
        self.spec = PolicySpec("approaching", horizon, interval, tuple(cameras), 32, privileged)
        self.wait = wait
        self.length = horizon if length is None else length
        self.episodes: list[Episode] = []
        self.queries: list[Query] = []
        self.views: list[Any] = []

    def reset(self, episode: Episode) -> None:
        self.episodes.append(episode)

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        self.queries.append(query)
        self.views.append(observation.get("agentview_image"))
        steps = query.step + np.arange(self.length)
        return np.where(steps[:, None] < self.wait, NOOP_ACTION, (0.35, 0.53, -0.77, 0, 0, 0, -1.0))


class Posing(Approaching):
    """Sends the hand to ``box_1`` under absolute control; its gripper commands are beyond 1."""

    def __init__(self, horizon: int = 1, interval: int = 1) -> None:
        super().__init__(horizon=horizon, interval=interval)
        self.spec = replace(self.spec, control="absolute")

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        super().predict(observation, query)
        share = np.linspace(0.2, 1.0, self.length)[:, None]
        way = np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]
        hand = observation["robot0_eef_pos"] + share * way
        return np.concatenate([hand, np.tile([0.0, 2.5, 0.0, -1.5], (self.length, 1))], axis=1)


class Solvable(TinyWorld):
    """A tiny world whose task is solved when ``solved`` says so."""

    def __init__(self, solved: Callable[[TinyWorld], bool] = lambda world: False) -> None:
        self._solved = solved
        super().__init__()

    def succeeded(self) -> bool:
        return self._solved(self)


class Looking(Solvable):
    """A world that counts the images it renders."""

    images = 0

    def observe(self, cameras: Sequence[str] | None = None, size: ImageSize = 256) -> dict[str, NDArray[Any]]:
        self.images += len(CAMERAS if cameras is None else cameras)
        return super().observe(cameras, size)


def policy_steps(world: TinyWorld) -> int:
    """Policy steps the world has played, settle steps not counted."""
    return world.steps - 10
