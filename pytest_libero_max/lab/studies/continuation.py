"""Several controllers that go on from one executed prefix: the study ``continue``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import Latency
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Entry, arms_of, one_later
from pytest_libero_max.events.triggers import AtStart
from pytest_libero_max.studies.study import Study

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import PolicySpec

OWN_BASE = "own_base"
"""Word in the settings that asks for each controller's own Base, and beginning of the names of these arms."""

RUN = "run"
"""Stands for the policy of the run among the names of controllers."""

_RESERVED = (OWN_BASE, RUN, "again")  # base_again is the arm of the noise floor
_LATENCY = re.compile(r"[1-9][0-9]{0,2}steps")
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_FORM = "Give FILE.py, FILE.py:NAME, PACKAGE.MODULE:NAME, a .toml file of servers, or an installed name"


class Controller(NamedTuple):
    """A policy that goes on from the event."""

    name: str
    """Name in the arms, in tables and in gates."""
    reference: str | None
    """Reference as the user gave it; None for the policy that is installed under the name."""


class Continue(Study):
    """Base and Dynamic of the run's policy, and each controller from the state that the event found.

    The arm ``dynamic_NAME`` has the event, ``base_NAME`` is the same handover without it. In both the
    controller is asked at once, and told what has been executed and what was queued
    (:class:`~pytest_libero_max.policies.contract.Handover`).

    Args:
        controllers: The controllers.
        own_base: True to play each controller's own Base as well, from the reset.
        latencies: Times that a query takes from the event on, each one more ``dynamic_NAME_dD`` beside
            ``dynamic_dD`` of the run's policy.

    Raises:
        OptionError: There is no controller, or two have one name.
    """

    name = "continue"
    title = "Controllers from one prefix"
    track = "lite"
    has_section = True
    example = "a.py,b.py (policies), also with own_base, 4steps (answers late by so much from the event on)"

    def __init__(
        self, *controllers: Controller, own_base: bool = False, latencies: tuple[Latency, ...] = ()
    ) -> None:
        self.controllers, self.own_base, self.latencies = controllers, own_base, latencies
        names = [controller.name for controller in controllers]
        if not names:
            raise OptionError(
                f"The study {self.name} needs policies: --libero-max-study={self.name}:{self.example}."
            )
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise OptionError.seen(
                f"--libero-max-study={self.name}",
                ",".join(names),
                f" names {twice!r} twice. Write NAME=REFERENCE to give each policy a name of its own.",
            )
        self.source = None if all(it.reference is None for it in controllers) else self._option()

    @classmethod
    def of(cls, settings: str | None) -> Self:
        """Read ``a.py,mine=b.py:make,expert,own_base,4steps``.

        A word alone is the name of an installed policy; the header of a run has nothing but such words, so
        that a folder of results names no code.

        Raises:
            OptionError: A part has another form.
        """
        parts = [part.strip() for part in (settings or "").split(",") if part.strip()]
        late = dict.fromkeys(part for part in parts if _LATENCY.fullmatch(part))
        return cls(
            *(_controller(part) for part in parts if part not in late and part != OWN_BASE),
            own_base=OWN_BASE in parts,
            latencies=tuple(map(Latency.parse, late)),
        )

    @property
    def policies(self) -> Mapping[str, str | None]:
        return dict(self.controllers)

    def seen_from_elsewhere(self, folder: Path) -> str | None:
        return None if self.source is None else self._option(folder)

    def _option(self, folder: Path | None = None) -> str:
        from pytest_libero_max.policies.references import absolute_reference

        spelled = [
            name
            if reference is None
            else f"{name}={reference if folder is None else absolute_reference(reference, folder)}"
            for name, reference in self.controllers
        ]
        return f"{self.name}:{','.join([*spelled, *self._words()])}"

    def _words(self) -> list[str]:
        return [*([OWN_BASE] if self.own_base else []), *map(str, self.latencies)]

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        from pytest_libero_max.changes.nothing import DelayAnswers, Nothing

        dynamic = next(arm for arm in arms_of(case, strength=strength) if arm.name == DYNAMIC)
        trigger = dynamic.schedule[0].trigger
        delayed = {
            f"_d{latency.steps}": (
                Entry(trigger, DelayAnswers(str(latency))),
                *map(one_later, dynamic.schedule),
            )
            for latency in self.latencies
        }
        arms = [Arm(DYNAMIC + end, schedule) for end, schedule in delayed.items()]
        for name, _ in self.controllers:
            handover = Arm(f"{BASE}_{name}", (Entry(trigger, Nothing()),), policy=name, at_once=True)
            arms += [replace(handover, name=f"{DYNAMIC}_{name}", schedule=dynamic.schedule), handover]
            arms += [
                replace(handover, name=f"{DYNAMIC}_{name}{end}", schedule=schedule)
                for end, schedule in delayed.items()
            ]
            if self.own_base:
                arms.append(Arm(f"{OWN_BASE}_{name}", (Entry(AtStart(), Nothing()),), policy=name))
        return tuple(arms)

    def to_dict(self) -> Json:
        """Return the study with the names of its controllers; where they come from is no part of it."""
        return {**super().to_dict(), "settings": ",".join([*dict(self.controllers), *self._words()])}


def _controller(text: str) -> Controller:
    from pytest_libero_max.policies.references import POLICIES

    given, sign, reference = text.partition("=")
    if not sign:
        given, reference = "", given
    alone = not sign and re.fullmatch(r"\w+", reference) is not None
    name = given or (reference if alone else _name_of(reference))
    if not _NAME.fullmatch(name):
        raise _refusal(text, f"the name {name!r} is not lower-case letters, digits and underscores")
    if name in _RESERVED or (not alone and name in POLICIES and reference != name):
        raise _refusal(text, f"{name!r} is the name of something else. Write mine={reference}")
    return Controller(name, None if alone or reference == name else reference)


def _name_of(reference: str) -> str:
    """Return the name of a controller without one: that of its file, or the one that is taken from it."""
    target, _, taken = reference.rpartition(":") if "://" not in reference else (reference, "", "")
    target, taken = (target, taken) if target else (taken, "")
    stem = Path(target).name.removesuffix(".py").removesuffix(".toml").rpartition(".")[2]
    return re.sub(r"\W", "_", (stem if taken in ("", "policy") else taken).lower())


def _refusal(text: str, rule: str) -> OptionError:
    return OptionError.seen("--libero-max-study=continue", text, f": {rule}. {_FORM}; commas go between.")
