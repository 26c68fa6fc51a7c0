"""Contract of a protocol in which policy servers are asked, and the protocols by the scheme of addresses.

A protocol is one module of the folder ``protocols``, called like its scheme (with ``_`` for ``-``), with one
:class:`ServerProtocol`. Another package offers its own, under its scheme, in the entry-point group
``pytest_libero_max.protocols``; a profile names it in ``policy.protocol``.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.registry import Registry, classes_in

if TYPE_CHECKING:
    from pytest_libero_max.policies.clients.address import Address
    from pytest_libero_max.policies.clients.messages import Request
    from pytest_libero_max.policies.clients.served import Adapt, ServedPolicy
    from pytest_libero_max.policies.clients.transport import Link
    from pytest_libero_max.policies.contract import PolicySpec
    from pytest_libero_max.policies.profile import Profile


@dataclass(frozen=True)
class Opening:
    """A policy behind a server that is about to be connected to."""

    address: Address
    profile: Profile
    spec: PolicySpec
    """Spec that the profile declares, with the options of the run."""
    request: Request
    """Makes requests."""
    horizon: int | None = None
    """H, the chunk size, where the run sets it."""
    query_interval: int | None = None
    """Q, the execution horizon, where the run sets it."""

    def choice(self, field: str, known: Mapping[str, Any]) -> str:
        """Return a field of the profile's ``policy`` that must be one of a few names.

        Raises:
            AdapterError: It is none of them; suggests the closest.
        """
        value = self.profile.get("policy", field)
        if value not in known:
            raise AdapterError(
                f"profile {self.profile.name!r}: policy.{field}={value!r}. {did_you_mean(str(value), known)}"
            )
        return str(value)


class ServerProtocol(ABC):
    """A protocol of policy servers."""

    scheme: ClassVar[str]
    """Begins the addresses, for example ``openpi`` in ``openpi://gpu-box:8000``."""
    port: ClassVar[int]
    """TCP port where an address names none."""
    secure_port: ClassVar[int | None] = None
    """The same with TLS (``SCHEME+tls://``); None for a protocol without."""
    recognised: ClassVar[bool] = False
    """True for the protocols that :mod:`.recognition` tells apart."""
    profiles: ClassVar[str] = ""
    """``policy.protocol`` of the profiles that fit; the scheme unless set."""

    @abstractmethod
    def link(self, opening: Opening) -> Link:
        """Return the connection, which is not open yet.

        Raises:
            AdapterError: The profile lacks a field that the protocol needs.
        """

    def adapt(self, opening: Opening) -> Adapt | None:
        """Return a function from the server's greeting to requests and spec; None to leave them unchanged."""
        return None

    def policy(self, greeting: Mapping[str, Any]) -> type[ServedPolicy]:
        """Return the class of the policy.

        Args:
            greeting: The server's description of itself; empty before it is connected to.
        """
        from pytest_libero_max.policies.clients.served import ServedPolicy

        return ServedPolicy


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
