"""The contract of a study: arms beside those of the pair, its cases, and conditions on each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, Self

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.schedules import Arm

if TYPE_CHECKING:
    from pytest_libero_max.pairing.runner import Pair
    from pytest_libero_max.policies.contract import PolicySpec


class Study(ABC):
    """A fixed set of arms over a set of cases.

    Every case of a study is played in Base and Dynamic as in any run, and in the arms of the study; all of
    them are one test item and one record.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    """Heading of its part of the report."""
    track: ClassVar[str]
    """The track that is played unless another one is asked for."""
    about: ClassVar[str] = "is of any kind"
    """Effect of the event of its cases, in words that follow "whose event"."""
    scales: ClassVar[bool] = False
    """True if the study itself sets strengths, so that a run cannot set one as well."""
    has_section: ClassVar[bool] = False
    """True if a report section compares its arms, so that nothing else of the report does."""
    example: ClassVar[str] = ""
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

    @abstractmethod
    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        """Return the arms beside Base and Dynamic.

        Args:
            case: The case.
            spec: The policy's spec.
            strength: Share of the event's change in the whole run.

        Raises:
            ChangeError: The event's change cannot be scaled.
        """

    def objection(self, case: Case) -> str | None:
        """Return why a case cannot be part of the study, as words after "these events"; None if it can."""
        return None

    def check_policy(self, spec: PolicySpec) -> None:  # noqa: B027  # most studies take every policy
        """Check that the policy can be played in the study's arms, before the first of them.

        Raises:
            AdapterError: It cannot.
        """

    def check(self, pair: Pair) -> None:  # noqa: B027  # most studies have nothing of their own to check
        """Check the conditions of the study on a case whose arms have been played.

        Raises:
            ProtocolError: It does not, so that the pair is invalid.
        """

    def to_dict(self) -> Json:
        """Return the study as the header of a run holds it."""
        return {"name": self.name}
