"""State of a run that was stopped before every planned pair was played: the last line of its pairs."""

from __future__ import annotations

from typing import ClassVar

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import Count, Document, Positive, Text, convert, to_builtins


class Stopped(Document, frozen=True, tag_field="line", tag="stopped"):
    """Reason a run was stopped.

    Attributes:
        reason: For people, without a period.
        of: Number of planned pairs.
        rule: The stopping rule as asked for, for example ``errors:3``, which makes this the end that was
            declared for the run; None where something broke, or ``-x`` stopped it.
        at: Number of pairs, the first ones in the order of play, on which the rule decided. Pairs that were
            played ahead of it or were in flight are stored as well. None without a rule.
    """

    NOUN: ClassVar[str] = "stop of a run"

    reason: Text
    of: Positive
    rule: Text | None = None
    at: Count | None = None

    @property
    def text(self) -> str:
        """One sentence, without a period."""
        if self.rule is None:
            return f"stopped: {self.reason}"
        return f"stopped by rule {self.rule} at {self.at} of {self.of}: {self.reason}"

    def to_dict(self) -> Json:
        """Return JSON types only."""
        values = to_builtins(self)
        del values["line"]
        return values

    @classmethod
    def from_dict(cls, values: Json) -> Stopped:
        """Read what :meth:`to_dict` wrote.

        Raises:
            ReportError: A field is missing or unknown, or holds what it cannot.
        """
        return convert(values, cls)
