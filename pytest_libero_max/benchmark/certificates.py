"""Certificates: results of a scripted expert on frozen cases, which decide nothing."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

from pytest_libero_max.benchmark.tracks import read_table

CERTIFICATES = "certificates.tsv.gz"
"""Name of the table in a folder of tracks."""

Ending = Literal["solved", "not_triggered", "base_unsolved", "unsolved"]
"""Endings: the expert completes the Dynamic episode; it never comes near the trigger entity; it completes
the task neither with the event nor without it; it completes it without the event only."""

ENDINGS: tuple[Ending, ...] = get_args(Ending)


@dataclass(frozen=True)
class Certificate:
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

    def to_dict(self) -> dict[str, Any]:
        """As JSON values; :meth:`from_dict` reads them."""
        return asdict(self)

    @classmethod
    def from_dict(cls, value: dict[str, Any]) -> Certificate:
        """Read what :meth:`to_dict` wrote.

        Raises:
            TypeError: It has other fields.
            ValueError: A value is none that a certificate can have.
        """
        certificate = cls(**value)
        steps = (certificate.trigger_step, certificate.steps)
        if certificate.ending not in ENDINGS or any(type(n) is not int for n in steps if n is not None):
            raise ValueError(f"no certificate: {value!r:.200}")
        return certificate


def read_certificates(folder: Path) -> dict[str, Certificate]:
    """Return the expert's results on the cases that it has played, by id.

    Raises:
        ManifestError: The table is missing or is not the one that was frozen.
    """
    return {
        name: Certificate(cast(Ending, ending), _number(trigger), _number(steps))
        for name, ending, trigger, steps in read_table(folder / CERTIFICATES)
    }


def _number(text: str) -> int | None:
    return int(text) if text else None
