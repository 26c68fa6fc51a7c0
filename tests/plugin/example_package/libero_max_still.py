"""A protocol in a package of its own, of a server that needs no network: every action holds still."""

from __future__ import annotations

from typing import Any

from pytest_libero_max import Opening, ServerProtocol


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
