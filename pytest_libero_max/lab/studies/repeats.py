"""Repeats: the same cases with other seeds of the policy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Entry, arms_of, one_later
from pytest_libero_max.events.triggers import AtStart
from pytest_libero_max.studies.study import Study

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import PolicySpec


PLAYS = 3
"""Number of plays of each case where none is given."""

LEAST_PLAYS = 2


class Repeats(Study):
    """Base and Dynamic with the case's policy seed, and again with other seeds from the first query on.

    The plays of a case are one item, one record and one pair: no statistic counts them as further pairs.
    Other seeds are given to the queries; what a policy draws from its episode's seed alone stays the same.
    """

    name = "repeats"
    title = "Repeats with other policy seeds"
    track = "smoke"
    has_section = True
    example = str(PLAYS)

    def __init__(self, plays: int = PLAYS) -> None:
        if plays < LEAST_PLAYS:
            raise OptionError.seen("repeats", plays, f", but a case is repeated from {LEAST_PLAYS} plays on.")
        self.plays = plays

    @classmethod
    def of(cls, settings: str | None) -> Self:
        if settings is None:
            return cls()
        if not settings.isdecimal() or int(settings) < LEAST_PLAYS:
            rule = f", but expected an integer of at least {LEAST_PLAYS}, the plays of each case."
            raise OptionError.seen("--libero-max-study=repeats", settings, rule)
        return cls(int(settings))

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        """Return a Base and a Dynamic for each further play, called ``base_2``, ``dynamic_2`` and so on."""
        from pytest_libero_max.changes.nothing import ReseedPolicy

        dynamic = next(arm for arm in arms_of(case, strength=strength) if arm.name == DYNAMIC)
        found, start = [], Entry(AtStart(), ReseedPolicy())
        for play in range(2, self.plays + 1):
            later = dynamic.schedule
            for _ in range(play - 1):
                later = (start, *map(one_later, later))
            found += [Arm(repeated(BASE, play), (start,) * (play - 1)), Arm(repeated(DYNAMIC, play), later)]
        return tuple(found)

    def to_dict(self) -> Json:
        return super().to_dict() | ({} if self.plays == PLAYS else {"settings": str(self.plays)})


def repeated(arm: str, play: int) -> str:
    """Return the name of Base or Dynamic in a play; the first is 1."""
    return arm if play == 1 else f"{arm}_{play}"
