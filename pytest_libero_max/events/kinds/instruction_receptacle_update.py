"""instruction_receptacle_update: the object is to be put somewhere else."""

from __future__ import annotations

from pytest_libero_max.events.intent import IntentEvent


class InstructionReceptacleUpdate(IntentEvent):
    """The policy is told to put the object somewhere else, and that is the goal from then on."""

    name = "instruction_receptacle_update"
    expected = "Keep to the object, and complete the new task."
