"""instruction_target_update: another object is to be taken."""

from __future__ import annotations

from pytest_libero_max.events.intent import IntentEvent


class InstructionTargetUpdate(IntentEvent):
    """The policy is told to take another object, and that is the goal from then on."""

    name = "instruction_target_update"
    expected = "Leave the target so far, and complete the new task."
