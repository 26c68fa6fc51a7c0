"""Things that happened in an arm, in words: the event of the case, or each change of a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PROGRAM, ArmRecord, FiringRecord, PairRecord

_WAITS = "nothing"
"""Operation of an entry that only waits for the next one."""

_WORDS: Mapping[str, str] = {
    "bump_object": "object bumped",
    "cancel_instruction": "task cancelled",
    "corrupt_picture": "pictures corrupted",
    "cover_entity": "object covered",
    "delay_answers": "answers delayed",
    "freeze_images": "pictures frozen",
    "hide_inputs": "inputs hidden",
    "insert_distractors": "distractors put in",
    "insert_obstacle": "obstacle put in",
    "move_object": "object moved",
    "offset_arm": "arm turned",
    "open_gripper": "gripper opened",
    "orbit_camera": "camera moved",
    "place_camera": "camera moved",
    "put_object": "object put elsewhere",
    "remove_object": "object removed",
    "replace_instruction": "instruction replaced",
    "reseed_policy": "policy given other seeds",
    "set_glare": "glare added to pictures",
    "set_instruction": "instruction replaced",
    "set_lamps": "lamps changed",
    "set_lighting": "light changed",
    "set_sensor_corruption": "pictures corrupted",
    "set_task": "task replaced",
    "set_texture": "texture changed",
    "set_visual_theme": "colours changed",
    "shift_camera": "camera moved",
    "swap_images": "pictures of another task shown",
    "turn_object": "object turned",
}
"""Words by operation; another operation is named as it is. The modules of changes import NumPy."""


@dataclass(frozen=True)
class Happening:
    """An entry of an arm's schedule that happened, and did not only wait."""

    firing: FiringRecord
    name: str
    """Name of the event, where it is that of the case; otherwise the change in words."""
    is_event: bool
    """True if it is the event of the case, which has a variant."""
    reverts: bool
    """True if it took back what ``name`` says."""


def happenings(record: PairRecord, arm: ArmRecord) -> list[Happening]:
    """Return everything that happened in an arm of a pair, in its order.

    In a program each change is named by itself, because the event of the case may not be among them.
    """
    own = None
    if PROGRAM not in record.fingerprints and DYNAMIC in record.arms:
        own = next((entry["change"]["operation"] for entry in record.arms[DYNAMIC].schedule), None)
    found = []
    for firing, entry in zip(arm.firings, arm.schedule, strict=False):
        reverts = "reverts" in entry
        change = arm.schedule[entry["reverts"]]["change"] if reverts else entry["change"]
        operation = change["operation"]
        if operation != _WAITS:
            is_event = operation == own
            name = record.event if is_event else _WORDS.get(operation, operation.replace("_", " "))
            found.append(Happening(firing, name, is_event, reverts))
    return found


def happenings_text(found: list[Happening]) -> str:
    """Return what happened and when, as the beginning of a sentence; empty where nothing did.

    For example "Camera shift at step 20", or "Pictures frozen at step 20, taken back at step 40".
    """
    parts = []
    for name in dict.fromkeys(one.name for one in found):
        steps, back = (
            [one.firing.step for one in found if one.name == name and one.reverts is reverts]
            for reverts in (False, True)
        )
        words = f"{name.replace('_', ' ')} {_when(steps)}"
        parts.append(f"{words}, taken back {_when(back)}" if back else words)
    text = " and ".join(parts)
    return text[:1].upper() + text[1:]


def _when(steps: list[int]) -> str:
    if len(steps) == 1:
        return f"at step {steps[0]}"
    return f"{len(steps)} times from step {steps[0]} to {steps[-1]}"


def arm_title(name: str, arm: ArmRecord | None) -> str:
    """Return the title of an arm, with its own policy where it has one."""
    title = {BASE: "Base", DYNAMIC: "Dynamic"}.get(name, name.replace("_", " "))
    return title if arm is None or arm.policy is None else f"{title} ({arm.policy['name']})"
