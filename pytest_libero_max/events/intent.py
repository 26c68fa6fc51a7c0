"""Events in which the task itself changes. They are read from manifests; none are drawn here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

from pytest_libero_max.benchmark.cases import INTENT
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.kind import EventKind, Response, Scenario

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity


class IntentEvent(EventKind):
    """An event of the authors' pairs that are scored by intent; their manifest spells it out."""

    family = "intent"
    code = INTENT
    severities = ("medium", "medium")
    response: ClassVar[Response] = "follow_update"
    needs = "to be spelled out by a manifest; none are drawn for other tasks."
    drawn = False

    def eligible(self, task: TaskMetadata) -> bool:
        return False

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        """Refuse with ManifestError: no parameters are drawn for these events."""
        raise ManifestError.seen("event", self.name, f" is not drawn. It needs {self.needs}")

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Nothing: no scenarios are drawn."""
        from hypothesis import strategies as st

        return st.nothing()
