"""Stopping rules: decide from the pairs measured so far, in the order of play, whether a run goes on.

A rule is asked after each pair of the longest completed prefix of the declared order, and sees nothing else.
So its decision is the same for any number of workers, whatever finishes first.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.errors import LiberoMaxError, OptionError, ReportError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.registry import Registry, classes_in
from pytest_libero_max.report.gates import Gate, parse_gates
from pytest_libero_max.report.report_document import Watched
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.stopped import RULES, RULES_GROUP, Stopped

BIAS = (
    "The estimates of a stopped run lie beyond the truth on average, on the side that stopped it. Simulated "
    "runs of 800 pairs that anytime:0.05 stopped without gates, with true changes of -5.0 and -10.0 "
    "points: -7.6 and -12.6 on average."
)
"""What rules that look at outcomes do to estimates; the numbers are those of ``reports/sequential.md``."""


@dataclass(frozen=True)
class Declared:
    """What is known of a run before it is played."""

    order: Order
    gates: Sequence[Gate]
    """Conditions that the finished report has to meet."""
    shards: int
    """Number of parts that the cases are divided into, of which the run plays one."""
    begun: Json | None
    """Provenance of the run that is resumed; None for a new one."""


class StoppingRule(ABC):
    """Decides when a run stops. It is deterministic: the same pairs in the same order, the same decision.

    Args:
        arguments: Text behind the colon in ``--libero-max-stop=NAME:ARGUMENTS``; empty where there is none.

    Raises:
        ValueError: The rule does not take it; names the accepted form.
    """

    decides_gates: ClassVar[bool] = False
    """True if the rule knows verdicts on gates, which are then a part of the run."""

    bias: ClassVar[str | None] = BIAS
    """The way in which the estimates of a stopped run are off on average, as sentences; None for a rule that
    does not look at outcomes."""

    def __init__(self, arguments: str) -> None:
        if arguments:
            raise ValueError("this rule takes no arguments")

    def begin(self, planned: Sequence[PlannedPair], gates: Sequence[Gate]) -> None:
        """Start with no pair seen.

        Args:
            planned: Every pair of the run, in the order of play.
            gates: Conditions that the finished report has to meet.
        """
        self.planned, self.gates = planned, gates

    def check(self, declared: Declared) -> str | None:
        """Look at a run before anything is played.

        Args:
            declared: What is known of the run by then.

        Returns:
            A line for the session's header; None for none.

        Raises:
            OptionError: The rule cannot decide on this run; names the cure.
        """
        return None

    def check_run(self, run: Run) -> None:  # noqa: B027  most rules have nothing to look at
        """Look at the plan and the provenance of a run, just before its first pair is played.

        Args:
            run: The run.

        Raises:
            OptionError: The rule cannot decide on this run; names the cure.
        """

    def watched(self) -> list[Watched]:
        """Return what the rule knows once it has decided; empty where that is the reason alone."""
        return []

    @abstractmethod
    def after(self, pair: PairRecord | PairError) -> str | None:
        """See the next pair in the order of play.

        Args:
            pair: The measured pair, or the error in its place.

        Returns:
            Reason to stop, without a period; None to go on.
        """


def _accept(name: str, rule: object) -> type[StoppingRule]:
    if not (isinstance(rule, type) and issubclass(rule, StoppingRule)):
        raise ValueError(f"{rule!r} is no subclass of StoppingRule")
    return rule


STOPPING_RULES: Registry[type[StoppingRule]] = Registry(
    "stopping rule", RULES_GROUP, classes_in(RULES, StoppingRule), _accept, OptionError
)
"""Every stopping rule by name."""


@dataclass(frozen=True)
class NamedRule:
    """A stopping rule as asked for."""

    text: str
    """``NAME`` or ``NAME:ARGUMENTS``."""
    rule: StoppingRule


def parse_rule(text: str) -> NamedRule:
    """Read ``NAME`` or ``NAME:ARGUMENTS``.

    Raises:
        ValueError: The rule does not take these arguments.
        OptionError: There is no such rule, or it cannot be loaded.
    """
    name, _, arguments = text.partition(":")
    return NamedRule(text, STOPPING_RULES[name](arguments))


class CompletedPrefix:
    """Asks a rule about the longest completed prefix of the order of play."""

    def __init__(self, named: NamedRule, planned: Sequence[PlannedPair], gates: Sequence[Gate]) -> None:
        self._named = named
        self._order = [pair.item_id for pair in planned]
        self._arrived: dict[str, PairRecord | PairError | None] = {}
        self._length, self._planned = 0, len(planned)
        named.rule.begin(planned, gates)

    def add(self, item_id: str, pair: PairRecord | PairError | None) -> Stopped | None:
        """Take in a pair in any order, and ask the rule as far as the prefix now reaches.

        Args:
            item_id: Of the pair. Of one that arrives twice, the first arrival counts.
            pair: The record or error; None for a pair that is not played, because the policy does not support
                its suite.

        Returns:
            The rule's decision to stop; None to go on. After a decision nothing is asked any more.
        """
        self._arrived.setdefault(item_id, pair)
        while self._length < len(self._order) and self._order[self._length] in self._arrived:
            pair = self._arrived[self._order[self._length]]
            self._length += 1
            reason = None if pair is None else self._named.rule.after(pair)
            if reason is not None and self._length < self._planned:  # otherwise there is nothing to stop
                self._order = []
                return Stopped(reason, self._planned, self._named.text, self._length)
        return None


def watched_by(
    stopped: Stopped,
    planned: Iterable[PlannedPair],
    pairs: Iterable[PairRecord | PairError],
    gates: Iterable[str],
) -> list[Watched]:
    """Return what the rule that stopped a run knew, found again from the same pairs.

    Args:
        pairs: Measured pairs and errors; of a pair that has both, the record comes first.

    Returns:
        What the rule knew after the pairs on which it decided; empty where there was no rule, or where the
        package that has it is not installed.

    Raises:
        ReportError: The rule takes no such arguments, or a gate is none.
    """
    if stopped.rule is None or stopped.at is None:
        return []
    try:
        rule = parse_rule(stopped.rule).rule
        if type(rule).watched is StoppingRule.watched:
            return []
        declared = parse_gates(gates)
    except LiberoMaxError:
        return []
    except ValueError as error:
        raise ReportError(f"rule={stopped.rule!r} of a stop, or a gate of the run: {error}.") from None
    found: dict[str, PairRecord | PairError] = {}
    for pair in pairs:
        found.setdefault(pair.item_id, pair)
    order = [*planned]
    rule.begin(order, declared)
    for place in order[: stopped.at]:
        if place.item_id in found:
            rule.after(found[place.item_id])
    return rule.watched()


def bias_of(stopped: Stopped) -> str | None:
    """Return the bias of the rule that stopped a run; that of most where its package is not installed."""
    if stopped.rule is None:
        return None
    try:
        return parse_rule(stopped.rule).rule.bias
    except (LiberoMaxError, ValueError):
        return BIAS


def level_of(name: str, arguments: str) -> float:
    """Return the level that a sequential rule is given, 0.05 where it is given none, or raise ValueError."""
    try:
        level = float(arguments or 0.05)
    except ValueError:
        level = math.nan
    if not 0 < level <= 0.5:
        raise ValueError(f"expected {name}:LEVEL, above 0 and up to 0.5, for example {name}:0.05")
    return level
