"""The protocols in which policy servers are asked, by the scheme of their addresses.

A protocol is one module of the folder ``protocols``, called like its scheme (with ``_`` for ``-``), with one
:class:`.protocol.ServerProtocol`. Another package offers its own, under its scheme, in the entry-point group
``pytest_libero_max.protocols``; a profile names it in ``policy.protocol``.
"""

from __future__ import annotations

import re

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.clients.protocol import ServerProtocol
from pytest_libero_max.registry import Registry, classes_in

_MODULES = "pytest_libero_max.policies.clients.protocols"
_SCHEME = re.compile(r"[a-z][a-z0-9+.-]*")


def _accept(scheme: str, protocol: object) -> ServerProtocol:
    """Return the protocol that was registered under a scheme, from its class or an instance of it."""
    if isinstance(protocol, type) and issubclass(protocol, ServerProtocol):
        protocol = protocol()
    if not isinstance(protocol, ServerProtocol):
        raise ValueError(f"{protocol!r} is not a subclass of pytest_libero_max.ServerProtocol")
    if not _SCHEME.fullmatch(scheme):
        raise ValueError(f"scheme={scheme!r}, but must be a scheme of an address, in lower case")
    port = getattr(protocol, "port", None)
    if type(port) is not int or not 0 < port < 2**16:
        raise ValueError(f"port={port!r}, but must be a TCP port")
    return protocol


PROTOCOLS: Registry[ServerProtocol] = Registry(
    "protocol",
    "pytest_libero_max.protocols",
    lambda: {name.replace("_", "-"): load for name, load in classes_in(_MODULES, ServerProtocol)().items()},
    _accept,
    AdapterError,
    attribute="scheme",
)
"""Every protocol by the scheme of its addresses."""
