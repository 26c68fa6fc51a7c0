"""Latency (inference delay): the same cases with answers that come some control steps later.

A delay changes the executed prefix, so every setting has a Base and a Dynamic of its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import MOST_STEPS, Latency
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Entry, change_of, trigger_of
from pytest_libero_max.studies.study import Study

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import PolicySpec

_SETTING = re.compile(r"([1-9][0-9]{0,2})(sync)?")


class LatencySweep(Study):
    """Base and Dynamic without delay, and at each of the settings.

    Args:
        settings: At least one, each once.

    Raises:
        OptionError: There is none, or one twice.
    """

    name = "latency"
    title = "Latency"
    track = "lite"

    def __init__(self, settings: Sequence[Latency]) -> None:
        self.settings = tuple(settings)
        if not self.settings or len(set(self.settings)) < len(self.settings):
            raise OptionError.seen(
                "settings", delays_text(self.settings), ", but give at least one, each once."
            )

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        """``base_d4`` and ``dynamic_d4`` for 4 steps, ``base_d4sync`` and so on for the runner that waits."""
        event = Entry(trigger_of(case), change_of(case, strength))
        return tuple(
            Arm(delay_arm(name, setting), schedule, latency=setting)
            for setting in self.settings
            for name, schedule in ((BASE, ()), (DYNAMIC, (event,)))
        )

    def to_dict(self) -> Json:
        return {**super().to_dict(), "settings": delays_text(self.settings)}


def delay_arm(name: str, setting: Latency) -> str:
    """Name of an arm at a setting."""
    return f"{name}_d{delays_text((setting,))}"


def parse_delays(text: str) -> tuple[Latency, ...]:
    """Read settings: steps, ``1,2,4,8``, each with ``sync`` behind it for the runner that waits.

    Raises:
        ValueError: The text is of another form; says which is expected.
    """
    settings = []
    for part in text.split(","):
        match = _SETTING.fullmatch(part.strip())
        if match is None:
            raise ValueError(
                f"expected steps from 1 to {MOST_STEPS}, several with commas, for example 1,2,4,8 or 4,4sync"
            )
        settings.append(Latency(int(match[1]), "sync" if match[2] else "async"))
    try:
        LatencySweep(settings)
    except OptionError as error:
        raise ValueError(str(error)) from None
    return tuple(settings)


def delays_text(settings: Sequence[Latency]) -> str:
    """Form that :func:`parse_delays` reads."""
    return ",".join(f"{setting.steps}{'sync' if setting.runner == 'sync' else ''}" for setting in settings)
