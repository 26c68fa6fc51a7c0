"""Search for the first of several revisions that loses what an earlier one completes.

The cases that the bad end loses are found first. Each revision between the ends then plays these cases alone,
in a random order, until the rule ``anytime`` has decided :data:`GATE`. The number of them that a revision
completes is fixed, and the order alone is random: the level of the rule assumes nothing about the policy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gates import parse_gates
from pytest_libero_max.report.render.terminal import aligned
from pytest_libero_max.runs.plan import unsupported_pairs
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.stats.sequential import log_evidence_of_change

GATE = "dynamic_sr > 50%"
"""Holds of a good revision, on the cases that the bad end loses."""

Verdict = Literal["good", "bad", "cannot be played"]


@dataclass(frozen=True)
class Lost:
    """Cases that one run completes in Dynamic and another one does not."""

    case_ids: tuple[str, ...]
    """Their ids, sorted."""
    gains: int
    """Number of cases of which it is the other way round."""
    pairs: int
    """Number of cases that both have measured."""

    @classmethod
    def between(cls, good: StoredRun, bad: StoredRun) -> Lost:
        """Compare two runs on the cases that both have measured."""
        before = {record.case_id: record.dynamic_success for record in good.records}
        now = {record.case_id: record.dynamic_success for record in bad.records if record.case_id in before}
        lost = sorted(case_id for case_id, success in now.items() if before[case_id] and not success)
        gains = sum(success and not before[case_id] for case_id, success in now.items())
        return cls(tuple(lost), gains, len(now))

    @property
    def p_value(self) -> float:
        """Of the sequential McNemar test, valid however often it was looked at; at most 1."""
        return min(1.0, math.exp(-log_evidence_of_change(len(self.case_ids), self.gains)))

    def shown(self, level: float) -> bool:
        """Return True if the bad run is shown to lose more than it gains."""
        return len(self.case_ids) > self.gains and self.p_value <= level


@dataclass(frozen=True)
class Looked:
    """Result of a revision."""

    name: str
    """Of the revision."""
    pairs: int
    """Number of pairs that it has played."""
    verdict: Verdict
    """Verdict."""
    completed: int = 0
    """Number of the lost cases that it completes in Dynamic."""
    of: int = 0
    """Number of the lost cases that it has played."""
    note: str = ""
    """For people, for example the subject of a commit."""


def has_ended(stored: StoredRun, *, by_rule: bool) -> bool:
    """Return True if a run has measured all that it supports, or if its stopping rule has ended it.

    Args:
        stored: The run.
        by_rule: False if only a run that is whole counts.
    """
    if by_rule and stored.stopped is not None and stored.stopped.rule is not None:
        return not (({error.case_id for error in stored.errors}) - stored.measured)
    policy = stored.records[0].policy if stored.records else None
    left_out = {pair.case_id for pair in unsupported_pairs(stored.run.planned, policy)}
    return (
        bool(stored.records) and {pair.case_id for pair in stored.run.planned} - left_out == stored.measured
    )


def completed(stored: StoredRun, case_ids: Sequence[str]) -> dict[str, bool]:
    """Return Dynamic success of the cases, among some, that a run has measured."""
    wanted = set(case_ids)
    return {record.case_id: record.dynamic_success for record in stored.records if record.case_id in wanted}


def verdict_of(stored: StoredRun) -> Verdict:
    """Return the verdict on a revision that has played lost cases, all or until its rule stopped it."""
    if stored.stopped is not None:
        report = build_report(
            stored.records, stored.errors, stored.run.planned, stored.run.provenance, stored.stopped
        )
        known = report.pairs.stopped.watched if report.pairs.stopped else []
        (verdict,) = (one.verdict for one in known if one.what == parse_gates([GATE])[0].text)
        return "good" if verdict == "passed" else "bad"
    solved = sum(record.dynamic_success for record in stored.records)
    return "good" if 2 * solved > len(stored.records) else "bad"


def first_bad(count: int, judge: Callable[[int], Verdict]) -> tuple[int, int]:
    """Bisect revisions of which the first is good and the last is bad.

    Where a revision cannot be played, the nearest one to the middle that was not tried is next.

    Args:
        count: Number of revisions, at least 2.
        judge: Returns the verdict on a revision by its number, from 0.

    Returns:
        The numbers of the last good and of the first bad revision. What lies between them cannot be played.
    """
    low, high, tried = 0, count - 1, set[int]()
    while left := [number for number in range(low + 1, high) if number not in tried]:
        number = min(left, key=lambda number: (abs(2 * number - low - high), number))
        verdict = judge(number)
        tried.add(number)
        if verdict == "good":
            low = number
        elif verdict == "bad":
            high = number
    return low, high


def table(looked: Sequence[Looked]) -> list[str]:
    """Return the lines of the table of revisions, in the order given."""
    rows = [("revision", "pairs", "lost cases completed", "verdict", "")]
    for one in looked:
        share = f"{one.completed} of {one.of}" if one.of else ""
        rows.append((one.name, str(one.pairs), share, one.verdict, one.note))
    return aligned(rows)
