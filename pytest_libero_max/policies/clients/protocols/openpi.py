"""openpi's protocol: WebSocket, one frame of metadata, then one msgpack map each way.

An error of the server comes as text, before it closes the connection. There is no message for a reset.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.codecs import OPENPI, Dialect, pack, unpack
from pytest_libero_max.policies.clients.protocol import Opening, ServerProtocol
from pytest_libero_max.policies.clients.recognition import (
    SERVED,
    STARVLA,
    Speech,
    is_starvla_reply,
    of_greeting,
    other_protocol,
)
from pytest_libero_max.policies.clients.served import (
    Adapt,
    DeclaredPolicy,
    RememberingPolicy,
    SeeingPolicy,
    ServedPolicy,
    as_declared,
    as_prepared,
)
from pytest_libero_max.policies.clients.transport import Link, reported
from pytest_libero_max.policies.clients.websocket import Socket


class OpenpiLink(Socket):
    """A connection to a server that speaks openpi's protocol."""

    fits: ClassVar[tuple[Speech, ...]] = (SERVED,)
    """Kinds of servers that a greeting may declare."""

    dialect: ClassVar[Dialect] = OPENPI
    message: bytes = b""

    def open(self) -> Any:
        """Connect and return the metadata."""
        super().open()
        metadata = self._read("the greeting of openpi's protocol")
        speech = of_greeting(metadata)
        if speech is not None and speech not in self.fits:
            raise other_protocol(speech, self._address, self._address.protocol)
        return metadata

    def ask(self, request: Any) -> Any:
        """Send the map of an observation and return the reply's map."""
        reply = self._asked(request)
        if is_starvla_reply(reply):
            raise other_protocol(STARVLA, self._address, self._address.protocol)
        return reply

    def _asked(self, request: Any) -> dict[Any, Any]:
        self.send(pack(request, OPENPI))
        return self._read()

    def _read(self, awaited: str = "") -> dict[Any, Any]:
        message = self.receive(awaited)
        if isinstance(message, str):
            lines = message.strip().splitlines()
            raise reported(lines[-1] if lines else "")
        self.message, reply = message, unpack(message, OPENPI)
        if not isinstance(reply, dict):
            raise ServerError(f"a message is a {type(reply).__name__}, but openpi's are maps")
        return reply


class OpenpiProtocol(ServerProtocol):
    """openpi's protocol. A server of `libero-max serve` declares its policy and its memory in it."""

    scheme = "openpi"
    port = 8000
    secure_port = 443
    recognised = True

    def link(self, opening: Opening) -> Link:
        return OpenpiLink(opening.address)

    def adapt(self, opening: Opening) -> Adapt:
        profile = opening.profile
        if not profile.get("policy", "declared_by_server", False):
            return as_prepared(profile)
        return as_declared(profile, opening.request, opening.horizon, opening.query_interval)

    def policy(self, greeting: Mapping[str, Any]) -> type[ServedPolicy]:
        if greeting.get("memory") is not True:
            return DeclaredPolicy
        return SeeingPolicy if greeting.get("sees") is True else RememberingPolicy
