"""A study: a program that is played beside Base and Dynamic, with a title and a part of the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Self

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.programs import Program
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Cadence, arms_of
from pytest_libero_max.policies.cadence import at_cadence

if TYPE_CHECKING:
    from pytest_libero_max.pairing.runner import Pair
    from pytest_libero_max.policies.contract import PolicySpec


class Study:
    """A fixed set of arms over a set of cases.

    Every case of a study is played in Base and Dynamic as in any run, and in the arms of the study; all of
    them are one test item and one record. A subclass has a ``program``, or says its arms in :meth:`arms`
    where they follow from more than data.
    """

    name: str
    title: str
    """Heading of its part of the report."""
    track: str
    """The track that is played unless another one is asked for."""
    program: Program | None = None
    """Its arms beside Base and Dynamic."""
    has_section: bool = False
    """True if a section of the report compares its arms by other rules than by event."""
    document: Json | None = None
    """What spells it, where its name does not say it."""
    source: str | None = None
    """Where it is found: the path of its file, or the value of the option where that names files of policies.
    None where name and settings say all of it."""
    example: str = ""
    """Settings, as they are given behind its name: ``--libero-max-study=NAME:SETTINGS``."""

    @classmethod
    def of(cls, settings: str | None) -> Self:
        """Return the study with settings, in the form that :meth:`to_dict` writes; None for the usual ones.

        Raises:
            OptionError: They have another form, or the study has none.
        """
        if settings is not None:
            raise OptionError.seen("settings", settings, f", but the study {cls.name} has none.")
        return cls()

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        """Return the arms beside Base and Dynamic; not those that are these, at the policy's own cadence.

        Args:
            case: The case.
            spec: The policy's spec.
            strength: Share of the event's change in the whole run.

        Raises:
            ChangeError: The event's change cannot be scaled.
        """
        base, dynamic, *arms = arms_of(replace(case, program=self.program), strength=strength)

        def as_played(arm: Arm) -> Arm:
            own = arm.policy is None and arm.cadence is not None and at_cadence(spec, arm.cadence) == spec
            return replace(arm, cadence=None) if own else arm

        def is_of_pair(arm: Arm) -> bool:
            return replace(arm, name=BASE) == base or replace(arm, name=DYNAMIC) == dynamic

        played = [(arm, as_played(arm)) for arm in arms]
        return tuple(now for arm, now in played if now is arm or not is_of_pair(now))

    @property
    def scales(self) -> bool:
        """True if the study itself sets strengths, so that a run cannot set one as well."""
        return any("strength" in entry for arm in self.spelled for entry in arm.get("schedule", ()))

    @property
    def policies(self) -> Mapping[str, str | None]:
        """Reference of each policy that its arms name as the user gave it; None for an installed one."""
        return {}

    def seen_from_elsewhere(self, folder: Path) -> str | None:
        """Return the value of the option that asks for the same study in another working folder.

        Args:
            folder: The folder in which it was asked for.

        Returns:
            None where its name and settings, or its document, say all of it.
        """
        return None

    @property
    def spelled(self) -> tuple[Json, ...]:
        """Its arms as data; none where they follow from more."""
        return () if self.program is None else self.program.arms

    def objection(self, case: Case) -> str | None:
        """Return why a case cannot be part of the study; None if it can."""
        return None if self.program is None or case.fits(self.program) else self.program.because

    def check_policy(self, spec: PolicySpec) -> None:
        """Check that the policy can be played in the study's arms, before the first of them.

        Raises:
            AdapterError: The Q of an arm is larger than the policy's own H.
        """
        for arm in self.spelled:
            if "cadence" in arm and "policy" not in arm:
                at_cadence(spec, Cadence(**arm["cadence"]))

    def check(self, pair: Pair) -> None:
        """Check the conditions of the study on a case whose arms have been played.

        Raises:
            ProtocolError: It does not, so that the pair is invalid.
        """

    def to_dict(self) -> Json:
        """Return the study as the header of a run holds it."""
        return {"name": self.name} | ({} if self.document is None else {"document": self.document})
