"""starVLA's protocol: openpi's transport with an envelope around requests and replies.

A reply says whether it is ``ok``; an error inside the routing comes as a map, any other as openpi's.
"""

from __future__ import annotations

from typing import Any, ClassVar

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.protocol import Opening, ServerProtocol
from pytest_libero_max.policies.clients.protocols.openpi import OpenpiLink
from pytest_libero_max.policies.clients.recognition import STARVLA, Speech
from pytest_libero_max.policies.clients.transport import reported


class StarvlaLink(OpenpiLink):
    """A connection to a server of the starVLA family (starVLA, VLA-JEPA, DiT4DiT)."""

    fits: ClassVar[tuple[Speech, ...]] = (STARVLA,)

    def ask(self, request: Any) -> Any:
        """Send a request and return the reply's ``data``."""
        reply = self._asked(request)
        if reply.get("ok") is False or "error" in reply:
            error = reply.get("error")
            raise reported(error.get("message", error) if isinstance(error, dict) else error)
        data = reply.get("data")
        if not isinstance(data, dict):
            raise ServerError(
                f"the reply has the keys {sorted(map(str, reply))}, but must have a map as 'data'"
            )
        return data


class StarvlaProtocol(ServerProtocol):
    """The protocol of the starVLA family."""

    scheme = "starvla"
    port = 10093
    secure_port = 443
    recognised = True

    def link(self, opening: Opening) -> StarvlaLink:
        return StarvlaLink(opening.address)
