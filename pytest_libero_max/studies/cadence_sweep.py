"""Query cadence: the same cases with other Q, and other H where that is asked for.

Another Q may change the executed prefix, so every setting has a Base and a Dynamic of its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Cadence, Entry, change_of, trigger_of
from pytest_libero_max.policies.cadence import at_cadence
from pytest_libero_max.studies.study import Study

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import PolicySpec

_SETTING = re.compile(r"(?:([1-9][0-9]{0,3})/)?([1-9][0-9]{0,3})")


class CadenceSweep(Study):
    """Base and Dynamic at the policy's own cadence, and at each of the settings.

    Args:
        settings: At least one, each once.

    Raises:
        OptionError: There is none, one twice, or one with Q > H.
    """

    name = "cadence"
    title = "Query cadence"
    track = "lite"

    def __init__(self, settings: Sequence[Cadence]) -> None:
        self.settings = tuple(settings)
        if not self.settings or len(set(self.settings)) < len(self.settings):
            raise OptionError.seen(
                "settings", cadence_text(self.settings), ", but give at least one, each once."
            )
        for setting in self.settings:
            if setting.horizon is not None and setting.query_interval > setting.horizon:
                raise OptionError(
                    f"setting {cadence_text((setting,))!r} has Q={setting.query_interval} > "
                    f"H={setting.horizon}: a query returns at most H actions, so Q <= H. Lower Q or raise H."
                )

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

    def to_dict(self) -> Json:
        return {**super().to_dict(), "settings": cadence_text(self.settings)}


def setting_arm(name: str, setting: Cadence) -> str:
    """Name of an arm at a setting."""
    horizon = "" if setting.horizon is None else f"h{setting.horizon}"
    return f"{name}_{horizon}q{setting.query_interval}"


def parse_cadence(text: str) -> tuple[Cadence, ...]:
    """Read settings: ``2,4,8`` with the policy's own H, or ``2/2,4/4,8/8`` with another (H/Q).

    Raises:
        ValueError: The text is of another form; says which is expected.
    """
    settings = []
    for part in text.split(","):
        match = _SETTING.fullmatch(part.strip())
        if match is None:
            raise ValueError("expected Q or H/Q, several with commas, for example 2,4,8 or 2/2,4/4,8/8")
        horizon, interval = match.groups()
        settings.append(Cadence(int(interval), None if horizon is None else int(horizon)))
    try:
        CadenceSweep(settings)
    except OptionError as error:
        raise ValueError(str(error)) from None
    return tuple(settings)


def cadence_text(settings: Sequence[Cadence]) -> str:
    """Form that :func:`parse_cadence` reads."""
    return ",".join(
        ("" if setting.horizon is None else f"{setting.horizon}/") + str(setting.query_interval)
        for setting in settings
    )
