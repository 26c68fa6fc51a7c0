"""Contract of a protocol in which policy servers are asked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from pytest_libero_max.errors import AdapterError, did_you_mean

if TYPE_CHECKING:
    from pytest_libero_max.policies.clients.address import Address
    from pytest_libero_max.policies.clients.request import Request
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
