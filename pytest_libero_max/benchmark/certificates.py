"""Certificates: results of a scripted expert on frozen cases, which decide nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, cast, get_args

from msgspec import Struct

from pytest_libero_max.benchmark.tracks import read_table

CERTIFICATES = "certificates.tsv.gz"
"""Name of the table in a folder of tracks."""

Ending = Literal["solved", "not_triggered", "base_unsolved", "unsolved"]
"""Endings: the expert completes the Dynamic episode; it never comes near the trigger entity; it completes
the task neither with the event nor without it; it completes it without the event only."""

ENDINGS: tuple[Ending, ...] = get_args(Ending)


class Certificate(Struct, frozen=True):
    """Result of the expert on a case: proof that it can be done, or that this expert cannot do it."""

    ending: Ending
    """Ending of its Dynamic episode."""
    trigger_step: int | None = None
    """Policy steps before the event; None where it did not happen."""
    steps: int | None = None
    """Policy steps of the Dynamic episode; None where the event did not happen."""

    @property
    def solved(self) -> bool:
        """True if the expert completes the case."""
        return self.ending == "solved"


def read_certificates(folder: Path) -> dict[str, Certificate]:
    """Return the expert's results on the cases that it has played, by id, or raise ManifestError."""
    return {
        name: Certificate(cast(Ending, ending), _number(trigger), _number(steps))
        for name, ending, trigger, steps in read_table(folder / CERTIFICATES)
    }


def _number(text: str) -> int | None:
    return int(text) if text else None
