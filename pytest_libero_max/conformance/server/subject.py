"""A policy server as the subject of rules: any number of clients, and what they are shown."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

from pytest_libero_max.conformance.policy.subject import PolicySubject, Shown, first_scene
from pytest_libero_max.policies.clients.address import Address
from pytest_libero_max.policies.clients.opening import open_server, parse_address, require_profile
from pytest_libero_max.policies.clients.served import ServedPolicy
from pytest_libero_max.policies.profile import Profile

PATIENCE_S = 5.0
"""Longest time to wait for a server that cannot be reached; somebody is waiting."""

TIMEOUT_S = 60.0
"""Longest time to wait for one answer."""


@dataclass
class ServerSubject:
    """A server by its address, and the profile by which it is asked."""

    address: Address
    profile: Profile
    shown: Shown

    @contextmanager
    def client(self) -> Iterator[PolicySubject]:
        """Connect another client, at the beginning of an episode.

        Raises:
            ServerError: The server was given up.
        """
        policy = open_server(self.address, self.profile)
        try:
            subject = PolicySubject(policy, self.shown)
            subject.start()
            yield subject
        finally:
            policy.client.close()

    @cached_property
    def repeatable(self) -> bool:
        """True if its answers repeat, as it or its profile declares."""
        with self.client() as client:
            return client.policy.spec.repeatable


def served(client: PolicySubject) -> ServedPolicy:
    """Return the policy of a client, which is one behind a server."""
    assert isinstance(client.policy, ServedPolicy)
    return client.policy


def open_at(address: str, profile: str | None, substrate: str = "embedded") -> ServerSubject:
    """Return the server at an address; it is not asked yet.

    Raises:
        AdapterError: The address or the profile cannot be used.
        ServerError: The server was given up: its spec says which images to show.
    """
    patient = parse_address(address)
    patient = replace(
        patient, timeout_s=min(patient.timeout_s, TIMEOUT_S), patience_s=min(patient.patience_s, PATIENCE_S)
    )
    known = require_profile(address, profile)
    policy = open_server(patient, known)
    try:
        shown = first_scene(policy, substrate)
    finally:
        policy.client.close()
    return ServerSubject(patient, known, shown)
