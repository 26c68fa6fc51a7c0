"""Rules, each of one property of a subject, and the findings of their examination."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial
from inspect import cleandoc
from typing import Any, Literal, TypeVar

from pytest_libero_max.errors import LiberoMaxError

Level = Literal["must", "should", "note"]
"""``must``: a subject that breaks the rule gives wrong results. ``should``: what breaks it is a mistake in
most subjects and intended in few. ``note``: it may be intended, and deserves attention."""

State = Literal["kept", "broken", "unexamined"]

T = TypeVar("T")


@dataclass(frozen=True)
class Finding:
    """Result of a rule, for the whole subject or one part of it."""

    state: State
    observed: str = ""
    expected: str = ""
    """The rule, in words; empty unless it is broken."""
    cure: str = ""
    """The likely mistake and its cure; empty unless it is broken or could not be examined."""
    part: str = ""
    """The part of the subject that it is about, for example ``input 'image'``; empty for the whole."""


kept, broken = partial(Finding, "kept"), partial(Finding, "broken")


def unexamined(reason: str, cure: str = "", part: str = "") -> Finding:
    """Return the finding of a rule that could not be examined."""
    return Finding("unexamined", reason, cure=cure, part=part)


def judged(holds: bool, observed: str, expected: str, cure: str, part: str = "") -> Finding:
    """Return the finding of an observation, which keeps the rule or breaks it."""
    return kept(observed, part=part) if holds else broken(observed, expected, cure, part)


class Measurements:
    """Measurements of a subject, each taken once for all rules that need it."""

    def once(self, measure: Callable[[Any], T]) -> T:
        """Return what a function makes of this subject; it is called once."""
        measured: dict[Callable[[Any], Any], Any] = self.__dict__.setdefault("_measured", {})
        if measure not in measured:
            measured[measure] = measure(self)
        result: T = measured[measure]
        return result


Findings = Finding | Iterable[Finding]


@dataclass(frozen=True)
class Rule:
    """One property that subjects of a kind are to have."""

    id: str
    """``KIND/AREA/NAME``, for example ``policy/images/rotated``; stable."""
    level: Level
    check: Callable[[Any], Findings]
    """Examines a subject of its kind: returns a finding, or yields several. An error of this package that it
    raises breaks the rule."""
    needs: str = ""
    """Id of the rule without which this one cannot be examined; empty for none."""

    def __post_init__(self) -> None:
        if self.id.count("/") != 2 or not all(self.id.split("/")):
            raise ValueError(f"id={self.id!r}, but the id of a rule is KIND/AREA/NAME")

    @property
    def kind(self) -> str:
        """Kind of its subjects, for example ``policy``."""
        return self.id.split("/")[0]

    @property
    def area(self) -> str:
        return self.id.split("/")[1]

    @property
    def title(self) -> str:
        """The rule in one sentence: the first line of its function's docstring."""
        return cleandoc(self.check.__doc__ or "").partition("\n\n")[0].replace("\n", " ").rstrip(".")


def rule(id: str, level: Level, *, needs: str = "") -> Callable[[Callable[..., Findings]], Rule]:
    """Make a function that examines a subject a :class:`Rule`; its docstring's first line states the rule."""
    return lambda check: Rule(id, level, check, needs)


@dataclass(frozen=True)
class Outcome:
    """A rule and its findings."""

    rule: Rule
    findings: tuple[Finding, ...]

    @property
    def state(self) -> State:
        """``broken`` if any finding is, else ``unexamined`` if any is or there is none, else ``kept``."""
        states = {finding.state for finding in self.findings}
        if "broken" in states:
            return "broken"
        return "kept" if states == {"kept"} else "unexamined"

    @property
    def broken(self) -> tuple[Finding, ...]:
        return tuple(finding for finding in self.findings if finding.state == "broken")

    @property
    def fails(self) -> bool:
        """True if it decides the exit status: a rule of level ``must`` is broken."""
        return self.rule.level == "must" and self.state == "broken"


class Examination:
    """Examines rules of one subject, each once."""

    def __init__(self, open: Callable[[], object], rules: Iterable[Rule]) -> None:
        self._open = cache(open)
        self._rules = {rule.id: rule for rule in rules}
        self._outcomes: dict[str, Outcome] = {}

    def outcome(self, id: str) -> Outcome:
        """Return the outcome of a rule."""
        if id not in self._outcomes:
            self._outcomes[id] = Outcome(self._rules[id], self._find(self._rules[id]))
        return self._outcomes[id]

    def outcomes(self) -> list[Outcome]:
        """Return the outcomes of all rules, in their order."""
        return [self.outcome(id) for id in self._rules]

    def _find(self, rule: Rule) -> tuple[Finding, ...]:
        if rule.needs and (reason := self._missing(rule.needs)):
            return (unexamined(reason, "Repair that first, and examine again."),)
        try:
            findings = rule.check(self._open())
            return (findings,) if isinstance(findings, Finding) else tuple(findings)
        except LiberoMaxError as error:
            return (broken(str(error).rstrip("."), rule.title, "Repair this first, and examine again."),)

    def _missing(self, id: str) -> str:
        """Return why a rule that others need is not kept; empty where it is."""
        needs = self._rules[id].needs
        above = self._missing(needs) if needs else ""
        return above or (f"{id} is broken" if self.outcome(id).state == "broken" else "")
