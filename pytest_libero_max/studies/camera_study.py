"""Camera timing and camera strength: the same change of the camera before the first query or in the middle.

Base has no event. In Reset the complete change happens before the policy's first input. Mid-task is Dynamic:
the change happens at the case's trigger, after the executed prefix of Base.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ProtocolError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Entry, change_of, trigger_of
from pytest_libero_max.events.triggers import AtStart, Proximity, distance_m, trigger_from_dict
from pytest_libero_max.studies.event_timing import RESET
from pytest_libero_max.studies.study import Study

if TYPE_CHECKING:
    from pytest_libero_max.pairing.record import ArmRecord
    from pytest_libero_max.pairing.rollout import RolloutResult
    from pytest_libero_max.pairing.runner import Pair
    from pytest_libero_max.policies.contract import PolicySpec

STRENGTHS = (0.25, 0.5, 1.0)
"""Strengths of the strength study. The last is the event itself."""

_CAMERA = "camera:"


def at_strength(arm: str, strength: float) -> str:
    """Name of an arm at a strength: ``reset`` and ``dynamic`` at 1, at less ``reset_25``, ``dynamic_50``."""
    return arm if strength == 1.0 else f"{arm}_{100 * strength:.0f}"


class CameraTiming(Study):
    """Base, Reset and Mid-task."""

    name = "camera-timing"
    title = "Camera timing"
    track = "camera"
    about = "changes a camera"
    strengths: ClassVar[tuple[float, ...]] = (1.0,)

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        """Reset at every strength of the study, and Mid-task at those below 1, which is Dynamic."""
        arms = []
        for share in self.strengths:
            change = change_of(case, share * strength)
            arms.append(Arm(at_strength(RESET, share), (Entry(AtStart(), change),)))
            if share != 1.0:
                arms.append(Arm(at_strength(DYNAMIC, share), (Entry(trigger_of(case), change),)))
        return tuple(arms)

    def objection(self, case: Case) -> str | None:
        factors = change_of(case).factors
        only_cameras = bool(factors) and all(factor.startswith(_CAMERA) for factor in factors)
        return None if only_cameras else "change something else"

    def check(self, pair: Pair) -> None:
        """Check the logged triggers against the trajectories, and the cameras of the arms with each other."""
        for name in pair.record.arms:
            if name.startswith(DYNAMIC):
                _require_crossing(pair, name)
        for share in self.strengths:
            _require_same_camera(
                pair.record.item_id,
                pair.record.arms[at_strength(RESET, share)],
                pair.record.arms[at_strength(DYNAMIC, share)],
            )


class CameraStrength(CameraTiming):
    """Reset and Mid-task at a quarter, at half and at the whole of the change, with one Base."""

    name = "camera-strength"
    title = "Camera strength"
    scales = True
    strengths = STRENGTHS


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
    one, other = (arm.firings[0].evidence["after"] for arm in (reset, middle))
    if one != other:
        raise ProtocolError(
            f"{item_id}: the camera is {one} after the change at the start, but {other} after the change in "
            "the middle. A policy or the scene moved it in between, so the arms cannot be compared."
        )
