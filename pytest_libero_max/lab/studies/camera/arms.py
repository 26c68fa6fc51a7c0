"""Camera timing and camera strength: the same change of the camera before the first query or in the middle.

Base has no event. In Reset the complete change happens before the policy's first input. Mid-task is Dynamic:
the change happens at the case's trigger, after the executed prefix of Base.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Self

from pytest_libero_max.benchmark.programs import read_document
from pytest_libero_max.errors import ProtocolError
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.events.triggers import Proximity, distance_m, trigger_from_dict
from pytest_libero_max.studies.registry import spelled_study
from pytest_libero_max.studies.study import Study

if TYPE_CHECKING:
    from pytest_libero_max.pairing.record import ArmRecord
    from pytest_libero_max.pairing.rollout import RolloutResult
    from pytest_libero_max.pairing.runner import Pair

RESET = "reset"


class CameraStudy(Study):
    """Base, Reset and Mid-task, at one strength or several (``reset_25``, ``dynamic_25``: a quarter)."""

    track = "camera"

    @classmethod
    def of(cls, settings: str | None) -> Self:
        study = super().of(settings)
        path = Path(__file__).with_name(f"{cls.name}.json")
        study.program = read_document(path, "study", spelled_study).program
        return study

    @property
    def strengths(self) -> dict[float, tuple[str, str]]:
        """Names of the arms of Reset and of Mid-task by strength, in the order of the program."""
        return {
            arm["schedule"][0].get("strength", 1.0): (arm["name"], DYNAMIC + arm["name"].removeprefix(RESET))
            for arm in self.spelled
            if arm["name"].startswith(RESET)
        }

    def check(self, pair: Pair) -> None:
        """Check the logged triggers against the trajectories, and the cameras of the arms with each other."""
        for name in pair.record.arms:
            if name.startswith(DYNAMIC):
                _require_crossing(pair, name)
        for arms in self.strengths.values():
            _require_same_camera(pair.record.item_id, *(pair.record.arms[name] for name in arms))


class CameraTiming(CameraStudy):
    """Reset and Mid-task with the whole change."""

    name = "camera-timing"
    title = "Camera timing"


class CameraStrength(CameraStudy):
    """Reset and Mid-task with a quarter, half and the whole of the change."""

    name = "camera-strength"
    title = "Camera strength"


def first_crossing(rollout: RolloutResult, within_m: float) -> int | None:
    """Return the first step with the end effector within a distance of the trigger entity, or None."""
    near = (
        distance_m(hand, entity) <= within_m
        for hand, entity in zip(rollout.end_effector, rollout.entity, strict=True)
    )
    return next((step for step, reached in enumerate(near, start=1) if reached), None)


def _require_crossing(pair: Pair, name: str) -> None:
    """Check that the event came at the first crossing that the trajectories show, or that there is none."""
    arm = pair.record.arms[name]
    trigger = trigger_from_dict(arm.schedule[0]["trigger"])
    assert isinstance(trigger, Proximity)
    logged = arm.firings[0].step if arm.firings else None
    for shown in (name, BASE):
        crossed = first_crossing(pair.rollouts[shown], trigger.distance_m)
        # A rollout that ends with the step that crosses has no time left for the event.
        if logged == crossed or (logged is None and crossed == arm.steps):
            continue
        raise ProtocolError(
            f"{pair.record.item_id}: the event of arm {name!r} is logged at step {logged}, but the "
            f"trajectory of {shown!r} first comes within {trigger.distance_m:g} m at step {crossed}. The "
            "world moved between a step and its record; report this."
        )


def _require_same_camera(item_id: str, reset: ArmRecord, middle: ArmRecord) -> None:
    """Check that the camera is bit for bit the same after both changes, where both happened."""
    if not reset.firings or not middle.firings:
        return
    at_start, in_the_middle = (arm.firings[0].evidence["after"] for arm in (reset, middle))
    if at_start != in_the_middle:
        raise ProtocolError(
            f"{item_id}: the camera is {at_start} after the change at the start, but {in_the_middle} after "
            "the change in the middle. A policy or the scene moved it in between, so the arms cannot be "
            "compared."
        )
