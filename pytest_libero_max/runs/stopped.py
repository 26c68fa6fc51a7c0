"""State of a run that was stopped before every planned pair was played: the last line of its pairs."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.fields import COUNT, POSITIVE, TEXT, check_fields


@dataclass(frozen=True)
class Stopped:
    """Why a run was stopped.

    Attributes:
        reason: For people, without a period.
        of: Number of planned pairs.
        rule: The stopping rule as asked for, for example ``errors:3``, which makes this the end that was
            declared for the run; None where something broke, or ``-x`` stopped it.
        at: Number of pairs, the first ones in the order of play, on which the rule decided. Pairs that were
            played ahead of it or were in flight are stored as well. None without a rule.
    """

    reason: str
    of: int
    rule: str | None = None
    at: int | None = None

    @property
    def text(self) -> str:
        """One sentence, without a period."""
        if self.rule is None:
            return f"stopped: {self.reason}"
        return f"stopped by rule {self.rule} at {self.at} of {self.of}: {self.reason}"

    def to_dict(self) -> Json:
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Json) -> Stopped:
        """Read what :meth:`to_dict` wrote.

        Raises:
            ReportError: A field is missing or unknown, or holds what it cannot.
        """
        return cls(**check_fields(values, _FIELDS, "stop of a run"))


_FIELDS = {"reason": TEXT, "of": POSITIVE, "rule": TEXT.or_null, "at": COUNT.or_null}
