"""The protocols in which policy servers are asked, by the scheme of their addresses.

A protocol is one module with a :class:`ServerProtocol`. Another package offers its own, under its scheme, in
the entry-point group ``pytest_libero_max.protocols``; a profile names it in ``policy.protocol``.
"""

from __future__ import annotations

import importlib
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.registry import Registry

if TYPE_CHECKING:
    from pytest_libero_max.policies.clients.address import Address
    from pytest_libero_max.policies.clients.request import Request
    from pytest_libero_max.policies.clients.served import Adapt, ServedPolicy
    from pytest_libero_max.policies.clients.transport import Link
    from pytest_libero_max.policies.contract import PolicySpec
    from pytest_libero_max.policies.profile import Profile


@dataclass(frozen=True)
class Opening:
    """A policy behind a server that is about to be connected to.

    Attributes:
        address: Address of the server.
        profile: Profile of the policy.
        spec: Spec that the profile declares, with the options of the run.
        request: Makes requests.
        horizon: H, the chunk size, where the run sets it.
        query_interval: Q, the execution horizon, where the run sets it.
    """

    address: Address
    profile: Profile
    spec: PolicySpec
    request: Request
    horizon: int | None = None
    query_interval: int | None = None

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
    """A protocol of policy servers.

    Attributes:
        scheme: Begins the addresses, for example ``openpi`` in ``openpi://gpu-box:8000``.
        port: TCP port where an address names none.
        profiles: ``policy.protocol`` of the profiles that fit; the scheme unless set.
    """

    scheme: ClassVar[str]
    port: ClassVar[int]
    profiles: ClassVar[str] = ""

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


_SCHEME = re.compile(r"[a-z][a-z0-9+.-]*")

_OWN = {
    "openpi": "openpi:OpenpiProtocol",
    "vla-eval": "vla_eval:VlaEvalProtocol",
    "http": "http_act:HttpProtocol",
    "https": "http_act:HttpsProtocol",
    "starvla": "starvla:StarvlaProtocol",
    "gr00t": "gr00t:Gr00tProtocol",
}


def _own() -> Mapping[str, Callable[[], ServerProtocol]]:
    return {scheme: partial(_load, scheme) for scheme in _OWN}


def _load(scheme: str) -> ServerProtocol:
    module, _, name = _OWN[scheme].partition(":")
    found = getattr(importlib.import_module(f"pytest_libero_max.policies.clients.{module}"), name)
    return _accept(scheme, found)


def _accept(scheme: str, found: object) -> ServerProtocol:
    """Return the protocol that was registered under a scheme, from its class or an instance of it.

    Raises:
        ValueError: It is none, or one of its attributes breaks a rule.
    """
    if isinstance(found, type) and issubclass(found, ServerProtocol):
        found = found()
    if not isinstance(found, ServerProtocol):
        raise ValueError(
            f"{found!r} is not a subclass of pytest_libero_max.policies.clients.protocols.ServerProtocol"
        )
    if getattr(found, "scheme", None) != scheme or not _SCHEME.fullmatch(scheme):
        raise ValueError(
            f"scheme={getattr(found, 'scheme', None)!r}, but it is registered as {scheme!r}; both must be "
            "the same scheme of an address, in lower case"
        )
    port = getattr(found, "port", None)
    if type(port) is not int or not 0 < port < 2**16:
        raise ValueError(f"port={port!r}, but must be a TCP port")
    return found


PROTOCOLS: Registry[ServerProtocol] = Registry(
    "protocol", "pytest_libero_max.protocols", _own, _accept, AdapterError
)
"""Every protocol by the scheme of its addresses."""
