"""A protocol of a server that needs no network: every action holds still. And a rule that asks for it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pytest_libero_max import Opening, ServerProtocol
from pytest_libero_max.conformance import Finding, broken, kept, rule


class StillLink:
    """A connection to nothing."""

    def open(self) -> Any:
        return {}

    def ask(self, request: Any) -> Any:
        return {"actions": [[0.0] * 6 + [-1.0]] * 4}

    def close(self) -> None:
        pass


class StillProtocol(ServerProtocol):
    """Addresses like ``still://anywhere``."""

    scheme = "still"
    port = 9

    def link(self, opening: Opening) -> StillLink:
        return StillLink()


@rule("policy/still/holds", "should", needs="policy/contract/answers")
def holds(subject: Any) -> Iterator[Finding]:
    """Hold still."""
    if subject.actions[:, :6].any():
        yield broken("the hand is moved", "a hand that holds still", "Return zeros.")
    else:
        yield kept("the hand holds still")
