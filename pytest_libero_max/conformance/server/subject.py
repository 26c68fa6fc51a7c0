"""A policy server as the subject of rules: any number of clients, and what they are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from pytest_libero_max.conformance.policy.subject import PolicySubject, Shown, first_scene
from pytest_libero_max.conformance.rules import Finding, Measurements, broken, kept, unexamined
from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.policies.clients.address import Address
from pytest_libero_max.policies.clients.opening import open_server, parse_address, require_profile
from pytest_libero_max.policies.clients.served import ServedPolicy
from pytest_libero_max.policies.clients.transport import Link
from pytest_libero_max.policies.profile import Profile

PATIENCE_S = 5.0
"""Longest time to wait for a server that cannot be reached; somebody is waiting."""

TIMEOUT_S = 60.0

NOT_REPEATABLE = "repeatable=False, so no two answers can be compared"


@dataclass
class ServerSubject(Measurements):
    """A server by its address, and the profile by which it is asked."""

    address: Address
    profile: Profile
    shown: Shown
    horizon: int | None = None
    """H (chunk size), where the profile does not say."""
    query_interval: int | None = None
    """Q (execution horizon), likewise."""

    @contextmanager
    def client(self) -> Iterator[PolicySubject]:
        """Connect another client, at the beginning of an episode."""
        policy = open_server(self.address, self.profile, self.horizon, self.query_interval)
        try:
            subject = PolicySubject(policy, self.shown)
            subject.start()
            yield subject
        finally:
            policy.client.close()

    def alone(self, *indices: int) -> list[Actions]:
        """Return the answers to queries that a client of its own asks, in one episode."""
        with self.client() as client:
            return [client.ask(index) for index in indices]

    @cached_property
    def repeatable(self) -> bool:
        """True if its answers repeat, as it or its profile declares."""
        with self.client() as client:
            return client.policy.spec.repeatable

    @cached_property
    def repeats(self) -> bool:
        """True if the same query gets the same answer again over the same connection."""
        with self.client() as client:
            first = client.ask(0)
            client.start()
            return same([first], [client.ask(0)])

    def not_comparable(self) -> Finding | None:
        """Return the finding of rules that compare two answers, where they cannot."""
        if not self.repeatable:
            return unexamined(NOT_REPEATABLE)
        return None if self.repeats else unexamined("the same query gets another answer each time")


class AlteredLink:
    """A link whose requests are altered before they are sent; it keeps the last one, and its reply."""

    def __init__(self, link: Link, alter: Callable[[Any], Any] = lambda request: request) -> None:
        self._link, self._alter = link, alter
        self.request: Any = None
        self.reply: Any = None

    def ask(self, request: Any) -> Any:
        """Send the altered request and return the reply."""
        self.request = self._alter(request)
        self.reply = self._link.ask(self.request)
        return self.reply

    def open(self) -> Any:
        return self._link.open()

    def close(self) -> None:
        self._link.close()


def alter_requests(
    client: PolicySubject, alter: Callable[[Any], Any] = lambda request: request
) -> AlteredLink:
    """Alter what a client sends from now on, and keep what it gets."""
    policy = served(client)
    link = AlteredLink(policy.client.link, alter)
    policy.client.link = link
    return link


def served(client: PolicySubject) -> ServedPolicy:
    """Return the policy of a client, which is one behind a server."""
    assert isinstance(client.policy, ServedPolicy)
    return client.policy


def same(first: list[Actions], second: list[Actions]) -> bool:
    """Return True if the answers are the same bytes."""
    return [answer.tobytes() for answer in first] == [answer.tobytes() for answer in second]


def is_in_words(error: str) -> bool:
    """Return True for an error that the server reported, rather than a lost connection."""
    return "reports an error" in error or "HTTP" in error


def still_answers(subject: ServerSubject, after: str) -> Finding:
    """Yield the finding that the next client is answered, or not."""
    try:
        subject.alone(0)
    except ServerError as error:
        return broken(
            f"after {after}: {error}".rstrip("."),
            "an answer to the next client",
            "One client must not take the server down: catch what a connection raises.",
        )
    else:
        return kept(f"after {after}, the next client is answered")


def open_at(
    address: str,
    profile: str | None,
    substrate: str = "embedded",
    horizon: int | None = None,
    query_interval: int | None = None,
) -> ServerSubject:
    """Return the server at an address, which is asked for its spec alone."""
    patient = parse_address(address)
    patient = replace(
        patient, timeout_s=min(patient.timeout_s, TIMEOUT_S), patience_s=min(patient.patience_s, PATIENCE_S)
    )
    known = require_profile(address, profile)
    policy = open_server(patient, known, horizon, query_interval)
    try:
        shown = first_scene(policy, substrate)
    finally:
        policy.client.close()
    return ServerSubject(patient, known, shown, horizon, query_interval)
