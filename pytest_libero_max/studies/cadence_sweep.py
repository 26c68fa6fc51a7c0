"""Query cadence: the same cases with other Q, and other H where that is asked for.

Another Q may change the executed prefix, so every setting has a Base and a Dynamic of its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Cadence, Entry, change_of, trigger_of
from pytest_libero_max.policies.cadence import at_cadence
from pytest_libero_max.studies.sweep import Sweep

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import PolicySpec


class CadenceSweep(Sweep[Cadence]):
    """Base and Dynamic at the policy's own cadence, and at each of the settings.

    Args:
        settings: At least one, each once.

    Raises:
        OptionError: There is none, one twice, or one with Q > H.
    """

    name = "cadence"
    title = "Query cadence"
    example = "2,4,8 (Q), or --libero-max-study=cadence:2/2,4/4,8/8 (H/Q)"
    form = re.compile(r"(?:([1-9][0-9]{0,3})/)?([1-9][0-9]{0,3})")
    expected = "Q or H/Q, several with commas, for example 2,4,8 or 2/2,4/4,8/8"

    def __init__(self, settings: Sequence[Cadence]) -> None:
        super().__init__(settings)
        for setting in self.settings:
            if setting.horizon is not None and setting.query_interval > setting.horizon:
                raise OptionError(
                    f"setting {self.write(setting)!r} has Q={setting.query_interval} > "
                    f"H={setting.horizon}: a query returns at most H actions, so Q <= H. Lower Q or raise H."
                )

    @staticmethod
    def read(match: re.Match[str]) -> Cadence:
        horizon, interval = match.groups()
        return Cadence(int(interval), None if horizon is None else int(horizon))

    @staticmethod
    def write(setting: Cadence) -> str:
        return ("" if setting.horizon is None else f"{setting.horizon}/") + str(setting.query_interval)

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        """``base_q4`` and ``dynamic_q4`` for Q = 4, ``base_h8q4`` and ``dynamic_h8q4`` with H = 8.

        A setting that is the policy's own cadence needs none: it is the pair of Base and Dynamic.
        """
        event = Entry(trigger_of(case), change_of(case, strength))
        return tuple(
            Arm(setting_arm(name, setting), schedule, cadence=setting)
            for setting in self.settings
            if at_cadence(spec, setting) != spec
            for name, schedule in ((BASE, ()), (DYNAMIC, (event,)))
        )

    def check_policy(self, spec: PolicySpec) -> None:
        """Refuse settings whose Q is larger than the policy's own H."""
        for setting in self.settings:
            at_cadence(spec, setting)


def setting_arm(name: str, setting: Cadence) -> str:
    """Name of an arm at a setting."""
    horizon = "" if setting.horizon is None else f"h{setting.horizon}"
    return f"{name}_{horizon}q{setting.query_interval}"
