"""Check, before the first pair, that the cases of a run can be played, in all their arms."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.errors import ChangeError, ManifestError, OptionError
from pytest_libero_max.events.schedules import arms_of, check_arms
from pytest_libero_max.policies.references import require_installed
from pytest_libero_max.studies.study import Study


def require_playable(
    cases: Iterable[Case], strength: float, study: Study | None, latency: Latency = NO_LATENCY
) -> None:
    """Refuse arms that cannot begin, cases whose event cannot be scaled, and those that do not fit the study.

    Raises:
        ChangeError: A change is malformed.
        ManifestError: An arm has nothing to go on from.
        AdapterError: The policy of an arm is not installed.
        OptionError: There are some; names their events and says how to leave them out.
    """
    cases = tuple(cases)
    _require_arms(cases, study, latency)
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


def _require_arms(cases: Iterable[Case], study: Study | None, latency: Latency) -> None:
    """Check the arms of each program once, in one of its cases, with those of the study."""
    beside = None if study is None else study.program
    for case in {case.program and case.program.digest: case for case in cases}.values():
        try:
            arms = arms_of(case)
            # A study is for cases without a program, which is asked below.
            if beside is not None and case.program is None and case.fits(beside):
                arms += arms_of(replace(case, program=beside))[2:]
            check_arms(replace(arm, latency=latency) if arm.latency == NO_LATENCY else arm for arm in arms)
        except ManifestError as error:
            raise error.within(f"case {case.case_id!r}") from error
        for name in {arm.policy for arm in arms} - {None}:
            require_installed(str(name))


def _listed(events: Counter[str]) -> str:
    return ", ".join(
        f"{name} ({count} case{'' if count == 1 else 's'})" for name, count in sorted(events.items())
    )


def _without(events: Iterable[str]) -> str:
    return " and ".join(f"not {name}" for name in sorted(events))
