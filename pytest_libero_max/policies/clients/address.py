"""Addresses of policy servers, as a user types them. Nothing is connected or imported here."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from urllib.parse import SplitResult, parse_qsl, urlsplit

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.policies.clients.protocols import PROTOCOLS

TIMEOUT_S = 120.0
"""Longest time for one answer, s. A server that compiles on its first query needs more: ``?timeout=600``."""

PATIENCE_S = 300.0
"""Longest time, s, to wait for a server that cannot be reached, for example while it restarts."""

TOKEN_VARIABLE = "LIBERO_MAX_SERVER_TOKEN"
"""Environment variable with the token of servers that ask for one."""

_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://")

_REFUSED = {
    "tcp": "is raw TCP, which the server of Xiaomi-Robotics-0 speaks with pickles",
    "pickle": "asks for pickles",
    "xiaomi": "is raw TCP with pickles",
    "grpc": "is LeRobot's gRPC service, whose messages are pickles",
}


@dataclass(frozen=True)
class Address:
    """Address of a policy server, and its time limits.

    Attributes:
        text: The address as the user typed it.
        scheme: A key of :data:`PROTOCOLS`.
        host: Name or number of the machine.
        port: TCP port.
        path: Of the URL; empty where none is given.
        timeout_s: Longest time for one answer.
        patience_s: Longest time to wait for a server that cannot be reached.
    """

    text: str
    scheme: str
    host: str
    port: int
    path: str
    timeout_s: float = TIMEOUT_S
    patience_s: float = PATIENCE_S

    @property
    def protocol(self) -> str:
        """Name of the protocol in profiles: for ``https`` it is ``http``."""
        return PROTOCOLS[self.scheme].profiles or self.scheme

    @property
    def where(self) -> str:
        """Host and port, for messages and URLs."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{host}:{self.port}"

    def __str__(self) -> str:
        return f"{self.scheme}://{self.where}{self.path}"


def server_token() -> str | None:
    """Return the token that the environment holds for servers; None where it holds none."""
    return os.environ.get(TOKEN_VARIABLE) or None


def is_address(text: str) -> bool:
    """Return True if a reference is the address of a server."""
    return _ADDRESS.match(text) is not None


def parse_address(text: str) -> Address:
    """Read the address of a policy server, ``SCHEME://HOST:PORT/PATH?timeout=SECONDS&patience=SECONDS``.

    Raises:
        AdapterError: It has no such form, or a scheme that is refused or unknown.
    """
    scheme = text.partition("://")[0].lower()
    if scheme in _REFUSED and scheme not in PROTOCOLS:
        raise AdapterError.seen(
            "policy",
            text,
            f" {_REFUSED[scheme]}. Whoever answers with a pickle can run any code here, so "
            "none is ever read. Put the model behind one of the protocols that are spoken "
            f"({', '.join(PROTOCOLS)}): a server is a few lines around it.",
        )
    if scheme in ("ws", "wss"):
        raise AdapterError.seen(
            "policy",
            text,
            " names a WebSocket, but not what is spoken over it. Write openpi://, "
            "vla-eval:// or starvla:// instead.",
        )
    if scheme not in PROTOCOLS:
        raise AdapterError.seen(
            "policy", text, f": {scheme!r} is no protocol that is spoken. {did_you_mean(scheme, PROTOCOLS)}"
        )
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError as error:
        raise AdapterError.seen(
            "policy", text, f" is no address: {error}. Write {scheme}://HOST:PORT."
        ) from None
    if not parts.hostname or parts.username or parts.fragment:
        raise AdapterError.seen(
            "policy", text, f": an address is {scheme}://HOST:PORT, without a user name or a fragment."
        )
    seconds = _seconds(text, parts)
    return Address(
        text,
        scheme,
        parts.hostname,
        PROTOCOLS[scheme].port if port is None else port,
        parts.path.rstrip("/"),
        seconds.get("timeout", TIMEOUT_S),
        seconds.get("patience", PATIENCE_S),
    )


def _seconds(text: str, parts: SplitResult) -> dict[str, float]:
    found: dict[str, float] = {}
    for name, value in parse_qsl(parts.query, keep_blank_values=True):
        if name not in ("timeout", "patience"):
            raise AdapterError.seen(
                "policy", text, f": {name!r} is no option. {did_you_mean(name, ('timeout', 'patience'))}"
            )
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = math.nan
        if not 0.0 < found[name] < math.inf:
            raise AdapterError.seen(
                "policy", text, f": {name}={value!r}, but must be a number of seconds above 0."
            )
    return found
