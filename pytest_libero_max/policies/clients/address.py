"""Addresses of policy servers. Nothing is connected or imported here."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace

TIMEOUT_S = 120.0
"""Longest time for one answer, s. A server that compiles on its first query needs more: ``?timeout=600``."""

PATIENCE_S = 300.0
"""Longest time, s, to wait for a server that cannot be reached, for example while it restarts."""

TOKEN_VARIABLE = "LIBERO_MAX_SERVER_TOKEN"
"""Environment variable with the token of servers that ask for one."""

LEFT_OUT = "Policy server"
"""Begins the sentences about servers that were left out of a list of equal ones."""

TLS = "+tls"
"""Ends the scheme of an encrypted connection, for example ``openpi+tls``; that of HTTP is ``https``."""

SERVER_FILE = ".toml"
"""Ending of a file that lists servers."""

_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://")


@dataclass(frozen=True)
class Address:
    """Address of a policy server, and its time limits."""

    text: str
    """The address as the user typed it."""
    scheme: str
    host: str
    port: int
    path: str
    """Path of the URL; empty where none is given."""
    timeout_s: float = TIMEOUT_S
    """Longest time for one answer."""
    patience_s: float = PATIENCE_S

    @property
    def protocol(self) -> str:
        """Scheme of its protocol: without the ending for TLS."""
        return self.scheme.removesuffix(TLS)

    @property
    def secure(self) -> bool:
        """True if the connection is encrypted (TLS)."""
        return self.scheme in ("https", f"{self.protocol}{TLS}")

    @property
    def where(self) -> str:
        """Host and port, for messages and URLs."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{host}:{self.port}"

    def over(self, protocol: str, secure: bool) -> Address:
        """Return the address in another protocol, with TLS or without."""
        plain = "http" if protocol == "https" else protocol
        encrypted = "https" if plain == "http" else f"{plain}{TLS}"
        return replace(self, scheme=encrypted if secure else plain)

    def __str__(self) -> str:
        return f"{self.scheme}://{self.where}{self.path}"


def server_token() -> str | None:
    """Return the token that the environment holds for servers; None where it holds none."""
    return os.environ.get(TOKEN_VARIABLE) or None


def is_address(text: str) -> bool:
    """Return True if a reference is the address of a server, or a list that begins with one."""
    return _ADDRESS.match(text) is not None


def is_served(text: str) -> bool:
    """Return True if a reference names servers: by an address, several of them, or a file that lists them."""
    return is_address(text) or text.endswith(SERVER_FILE)
