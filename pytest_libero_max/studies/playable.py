"""Check, before the first pair, that the cases of a run can be played at its strength and in its study."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ChangeError, OptionError
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.studies.study import Study


def require_playable(cases: Iterable[Case], strength: float, study: Study | None) -> None:
    """Refuse cases whose event cannot be scaled, or which cannot be part of the study.

    Raises:
        ChangeError: A change is malformed.
        OptionError: There are some; names their events and says how to leave them out.
    """
    if strength == 1.0 and study is None:
        return
    whole: Counter[str] = Counter()
    objections: dict[str, Counter[str]] = {}
    for case in cases:
        try:
            arms_of(case, strength=strength)
        except ChangeError:
            arms_of(case)  # raises where it is the change itself that is malformed
            whole[case.event.name] += 1
        if study is None:
            continue
        objection = study.objection(case) if case.program is None else "they have programs of their own."
        if objection is not None:
            objections.setdefault(objection, Counter())[case.event.name] += 1
    if whole:
        raise OptionError(
            f"--libero-max-strength={strength:g}, but these events happen whole or not at all: "
            f"{_listed(whole)}. Leave them out with -m {_without(whole)!r}, or give strength 0 or 1."
        )
    for objection, events in objections.items():
        assert study is not None
        raise OptionError(
            f"The study {study.name} does not fit cases of {_listed(events)}: {objection} Play the track "
            f"{study.track}, or leave them out with -m {_without(events)!r}."
        )


def _listed(events: Counter[str]) -> str:
    return ", ".join(
        f"{name} ({count} case{'' if count == 1 else 's'})" for name, count in sorted(events.items())
    )


def _without(events: Iterable[str]) -> str:
    return " and ".join(f"not {name}" for name in sorted(events))
