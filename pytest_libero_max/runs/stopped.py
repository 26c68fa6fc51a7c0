"""State of a run that was stopped before every planned pair was played: the last line of its pairs."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from importlib.metadata import entry_points
from typing import Annotated, ClassVar

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import Document, Positive, Text, convert, rule, shown, to_builtins
from pytest_libero_max.errors import ReportError, counted, did_you_mean
from pytest_libero_max.registry import modules_in
from pytest_libero_max.runs.plan import PlannedPair, Run, unsupported_pairs

RULES = "pytest_libero_max.report.stopping_rules"
"""Package whose modules are the stopping rules; their names are needed where no report is computed."""

RULES_GROUP = "pytest_libero_max.stopping_rules"
"""Entry-point group of those of other packages."""

RuleText = Annotated[str, rule("NAME or NAME:ARGUMENTS", pattern=r"^[^:\s]+(:.+)?$(?!\n)")]


class Stopped(Document, frozen=True, tag_field="line", tag="stopped"):
    """Reason a run was stopped."""

    NOUN: ClassVar[str] = "stop of a run"

    reason: Text
    """For people, without a period."""
    of: Positive
    """Number of planned pairs."""
    rule: RuleText | None = None
    """The stopping rule as asked for, for example ``errors:3``, which makes this the end that was declared
    for the run; None where something broke, or ``-x`` stopped it."""
    at: Positive | None = None
    """Number of pairs, the first ones in the order of play, on which the rule decided. Pairs that were played
    ahead of it or were in flight are stored as well. None without a rule."""

    def require_of(self, run: Run) -> None:
        """Check that a run may have been stopped like this.

        A rule of a package that is not installed here is known where the run declared it.

        Raises:
            ReportError: It has another number of pairs, or there is no such rule.
        """
        if self.of != len(run.planned):
            raise ReportError(f"of={self.of}, but the run has {counted(len(run.planned), 'planned pair')}.")
        if (self.rule is None) != (self.at is None):
            raise ReportError(
                f"rule={shown(self.rule)} and at={self.at} of a stop, but it has both or neither."
            )
        if self.at is not None and self.at > self.of:
            raise ReportError(f"at={self.at} of a stop, but of={counted(self.of, 'pair')}.")
        if self.rule is None or self.rule == run.provenance.get("stopping_rule"):
            return
        known = [*modules_in(RULES), *(point.name for point in entry_points(group=RULES_GROUP))]
        name = self.rule.partition(":")[0]
        if name not in known:
            raise ReportError(f"rule={shown(self.rule)} of a stop is no rule. {did_you_mean(name, known)}")

    @property
    def text(self) -> str:
        """One sentence, without a period."""
        if self.rule is None:
            return f"stopped: {self.reason}"
        return f"stopped by rule {self.rule} at pair {self.at} of {self.of}: {self.reason}"

    def to_dict(self) -> Json:
        """Return JSON types only."""
        values = to_builtins(self)
        del values["line"]
        return values

    @classmethod
    def from_dict(cls, values: Json) -> Stopped:
        """Read what :meth:`to_dict` wrote, or raise ReportError."""
        return convert(values, cls)


def ended_by_rule(
    stopped: Stopped | None, planned: Iterable[PlannedPair], policy: Json | None, measured: Collection[str]
) -> bool:
    """Return True if a rule kept a run from its planned number of pairs, so that it has no usual interval.

    Pairs in flight may complete a run that its rule has stopped. That run is of the number of pairs that was
    fixed before, as one without a rule, and keeps its intervals.
    """
    if stopped is None or stopped.rule is None:
        return False
    pairs = [*planned]
    unsupported = {pair.case_id for pair in unsupported_pairs(pairs, policy)}
    return any(pair.case_id not in measured and pair.case_id not in unsupported for pair in pairs)
