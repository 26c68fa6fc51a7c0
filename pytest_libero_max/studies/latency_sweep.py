"""Latency (inference delay): the same cases with answers that come some control steps later.

A delay changes the executed prefix, so every setting has a Base and a Dynamic of its own.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.latency import MOST_STEPS, Latency
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Entry, change_of, trigger_of
from pytest_libero_max.studies.sweep import Sweep

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import PolicySpec


class LatencySweep(Sweep[Latency]):
    """Base and Dynamic without delay, and at each of the settings: steps, ``sync`` for a runner that waits.

    Args:
        settings: At least one, each once.

    Raises:
        OptionError: There is none, or one twice.
    """

    name = "latency"
    title = "Latency"
    example = "1,2,4,8 (control steps)"
    form = re.compile(r"([1-9][0-9]{0,2})(sync)?")
    expected = f"steps from 1 to {MOST_STEPS}, several with commas, for example 1,2,4,8 or 4,4sync"

    @staticmethod
    def read(match: re.Match[str]) -> Latency:
        return Latency(int(match[1]), "sync" if match[2] else "async")

    @staticmethod
    def write(setting: Latency) -> str:
        return f"{setting.steps}{'sync' if setting.runner == 'sync' else ''}"

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        """``base_d4`` and ``dynamic_d4`` for 4 steps, ``base_d4sync`` and so on for the runner that waits."""
        event = Entry(trigger_of(case), change_of(case, strength))
        return tuple(
            Arm(delay_arm(name, setting), schedule, latency=setting)
            for setting in self.settings
            for name, schedule in ((BASE, ()), (DYNAMIC, (event,)))
        )


def delay_arm(name: str, setting: Latency) -> str:
    """Name of an arm at a setting."""
    return f"{name}_d{LatencySweep.write(setting)}"
