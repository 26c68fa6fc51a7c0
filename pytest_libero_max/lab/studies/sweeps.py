"""Sweeps: Base and Dynamic once more at each of several cadences (H and Q), or of several latencies.

Another cadence or latency may change the executed prefix, so every setting has its own Base and Dynamic.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from typing import ClassVar, Self

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import MOST_STEPS
from pytest_libero_max.benchmark.programs import BASE, DYNAMIC, EVENT, parse_program
from pytest_libero_max.errors import ManifestError, OptionError
from pytest_libero_max.studies.study import Study


class Sweep(Study):
    """Base and Dynamic as the run plays them, and at each of some settings, which have one form."""

    track = "lite"
    form: ClassVar[re.Pattern[str]]
    """Pattern of the text of one setting."""
    expected: ClassVar[str]
    """The form in words, with an example."""

    def __init__(self, *settings: str) -> None:
        self.settings, flag = ",".join(settings), f"--libero-max-study={self.name}"
        matches = [self.form.fullmatch(text) for text in settings]
        read = [self.read(match) for match in matches if match is not None]
        if len(read) < len(matches):
            raise OptionError.seen(flag, self.settings, f", but expected {self.expected}.")
        if not read or len(dict(read)) < len(read):
            raise OptionError.seen("settings", self.settings, ", but give at least one, each once.")
        event = {"trigger": EVENT, "change": EVENT}
        arms = [
            {"name": f"{name}_{end}", "schedule": schedule, **how}
            for end, how in read
            for name, schedule in ((BASE, []), (DYNAMIC, [event]))
        ]
        try:
            self.program = parse_program({"name": self.name, "arms": arms})
        except ManifestError as error:
            raise OptionError(f"{flag}:{self.settings}: {error}") from error

    @staticmethod
    @abstractmethod
    def read(match: re.Match[str]) -> tuple[str, Json]:
        """Return the end of the names of a setting's arms, and what they have of their own."""

    @classmethod
    def of(cls, settings: str | None) -> Self:
        if settings is None:
            raise OptionError(
                f"The study {cls.name} needs its settings: --libero-max-study={cls.name}:{cls.example}."
            )
        return cls(*(text.strip() for text in settings.split(",")))

    def to_dict(self) -> Json:
        return {**super().to_dict(), "settings": self.settings}


class CadenceSweep(Sweep):
    """Arms ``base_q4`` and ``dynamic_q4`` for Q = 4, ``base_h8q4`` and ``dynamic_h8q4`` with H = 8."""

    name = "cadence"
    title = "Query cadence"
    example = "2,4,8 (Q), or --libero-max-study=cadence:2/2,4/4,8/8 (H/Q)"
    form = re.compile(r"(?:([1-9][0-9]{0,3})/)?([1-9][0-9]{0,3})")
    expected = "Q or H/Q, several with commas, for example 2,4,8 or 2/2,4/4,8/8"

    @staticmethod
    def read(match: re.Match[str]) -> tuple[str, Json]:
        horizon, interval = match.groups()
        if horizon is None:
            return f"q{interval}", {"cadence": {"query_interval": int(interval)}}
        return f"h{horizon}q{interval}", {
            "cadence": {"query_interval": int(interval), "horizon": int(horizon)}
        }


class LatencySweep(Sweep):
    """Arms ``base_d4`` and ``dynamic_d4`` for 4 steps, ``base_d4sync`` and so on for a runner that waits."""

    name = "latency"
    title = "Latency"
    example = "1,2,4,8 (control steps)"
    form = re.compile(r"([1-9][0-9]{0,2})(sync)?")
    expected = f"steps from 1 to {MOST_STEPS}, several with commas, for example 1,2,4,8 or 4,4sync"

    @staticmethod
    def read(match: re.Match[str]) -> tuple[str, Json]:
        return f"d{match[0]}", {"latency": f"{match[1]}steps" + (",sync" if match[2] else "")}
