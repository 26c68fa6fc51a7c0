"""Rules of the contract of a server: it greets, answers, repeats itself, and returns what it declares."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.policy.subject import QUERIES
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.conformance.server.subject import (
    NOT_REPEATABLE,
    ServerSubject,
    alter_requests,
    served,
)
from pytest_libero_max.errors import counted
from pytest_libero_max.policies.clients.codecs import OPENPI, foreign_arrays, pack

CONNECTS = "server/contract/connects"
ANSWERS = "server/contract/answers"

RANGE_TOLERANCE = 0.01
"""Largest excess over a declared range, as vla-eval's own check permits it."""


@rule(CONNECTS, "must")
def connects(subject: ServerSubject) -> Finding:
    """Accept a client, and greet it as the protocol asks."""
    with subject.client() as client:
        spec = client.policy.spec
        return kept(f"{spec.name} (H={spec.horizon} Q={spec.query_interval})")


@rule(ANSWERS, "must", needs=CONNECTS)
def answers(subject: ServerSubject) -> Finding:
    """Answer every query of an episode without an interruption."""
    with subject.client() as client:
        for index in range(QUERIES):
            client.ask(index)
        interruptions = served(client).client.interruptions
    if interruptions == 0:
        return kept(f"{counted(QUERIES, 'query', 'queries')} were answered")
    return broken(
        f"{counted(QUERIES, 'query', 'queries')} met {counted(interruptions, 'interruption')}",
        "no interruption",
        "Look at the server's own output.",
    )


@rule("server/contract/greeting", "should", needs=CONNECTS)
def greeting(subject: ServerSubject) -> Finding:
    """Greet every client alike."""
    greetings = []
    for _ in range(2):
        with subject.client() as client:
            greetings.append(served(client).greeting)
    first, second = greetings
    if not first and not second:
        return kept("the greeting declares nothing")
    changed = sorted(str(key) for key in {*first, *second} if _bytes(first, key) != _bytes(second, key))
    if not changed:
        return kept(f"two clients get the same greeting, which declares {', '.join(map(str, first))}")
    return broken(
        f"two clients get different greetings: {', '.join(changed)}",
        "the same greeting",
        "Declare the policy when the server starts. What changes with each client belongs into a reply.",
    )


def _bytes(greeting: Mapping[Any, Any], key: Any) -> bytes | None:
    return pack(greeting[key], OPENPI) if key in greeting else None


@rule("server/contract/chunk", "should", needs=ANSWERS)
def chunk(subject: ServerSubject) -> Finding:
    """Return as many actions as the server or its profile declares."""
    with subject.client() as client:
        client.ask(0)
        returned, declared = served(client).returned, client.policy.spec.horizon
        own = served(client).greeting.get("action_chunk_size")
    if returned is None:
        return unexamined("the number of actions in a reply is not known")
    said, words = (own, "action_chunk_size") if isinstance(own, int) else (declared, "horizon")
    return judged(
        returned == said,
        f"a reply has {counted(returned, 'action')}",
        f"{words}={said}, as declared",
        "Declare the H that the model returns, or choose the profile of this checkpoint.",
    )


@rule("server/contract/action-spec", "should", needs=ANSWERS)
def action_spec(subject: ServerSubject) -> Finding:
    """Return actions of the width and within the ranges that the greeting declares."""
    with subject.client() as client:
        link = alter_requests(client)
        client.ask(0)
        parts = _declared_parts(served(client).greeting)
        actions = _actions_in(link.reply, subject)
    if not parts or len(actions) != 1:
        return unexamined("the greeting does not declare the parts of an action (action_spec)")
    (array,) = actions
    width = sum(dims for dims, _ in parts.values())
    if array.shape[-1] != width:
        return broken(
            f"actions have {counted(array.shape[-1], 'component')}",
            f"{width}: {', '.join(f'{name} {dims}' for name, (dims, _) in parts.items())}, as declared",
            "Declare what the model returns (get_action_spec), or cut what is not LIBERO's.",
        )
    return _within_ranges(array, parts)


def _within_ranges(actions: NDArray[Any], parts: Mapping[str, tuple[int, Any]]) -> Finding:
    column = 0
    for name, (dims, bounds) in parts.items():
        values, column = actions[..., column : column + dims], column + dims
        if bounds is None or not values.size:
            continue
        least, most = bounds
        if values.min() < least - RANGE_TOLERANCE or values.max() > most + RANGE_TOLERANCE:
            return broken(
                f"{name} is {values.min():.3g} to {values.max():.3g}",
                f"{least:g} to {most:g}, as declared",
                "Declare the range that the model returns, or clip its actions.",
            )
    return kept(f"actions have the {counted(len(parts), 'part')} that the greeting declares")


def _declared_parts(greeting: Mapping[Any, Any]) -> dict[str, tuple[int, Any]]:
    """Return components and range of each part of an action; empty where none or not all are declared."""
    declared = greeting.get("action_spec")
    parts: dict[str, tuple[int, Any]] = {}
    for name, part in declared.items() if isinstance(declared, Mapping) else ():
        dims = part.get("dims") if isinstance(part, Mapping) else None
        if not isinstance(dims, int) or dims < 1:  # vla-eval writes 0 for "raw"
            return {}
        bounds = part.get("range")
        parts[str(name)] = dims, bounds if isinstance(bounds, list) and len(bounds) == 2 else None
    return parts


@rule("server/contract/precision", "should", needs=ANSWERS)
def precision(subject: ServerSubject) -> Finding:
    """Return actions as numbers of single or double precision."""
    with subject.client() as client:
        link = alter_requests(client)
        client.ask(0)
    arrays = _actions_in(link.reply, subject)
    types = sorted({str(array.dtype) for array in arrays})
    coarse = [str(array.dtype) for array in arrays if array.dtype.kind != "f" or array.dtype.itemsize < 4]
    if not arrays:
        return kept("actions come as lists of numbers")
    if not coarse:
        return kept(f"actions come as {', '.join(types)}")
    return broken(
        f"actions come as {', '.join(coarse)}",
        "float32 or float64",
        "Convert them before they are sent: actions.astype(np.float32).",
    )


def _actions_in(reply: Any, subject: ServerSubject) -> list[NDArray[Any]]:
    """Return the arrays of actions in a reply; empty where they come as lists or files."""
    value = reply
    for key in subject.profile.get("reply", "at", []):
        value = value.get(key) if isinstance(value, Mapping) else None
    parts = subject.profile.get("reply", "parts", [])
    values = [value.get(part) for part in parts] if parts and isinstance(value, Mapping) else [value]
    return [array for array in values if isinstance(array, np.ndarray) and array.ndim]


@rule("server/contract/encoding", "should", needs=ANSWERS)
def encoding(subject: ServerSubject) -> Finding:
    """Write arrays as the clients of its protocol read them."""
    with subject.client() as client:
        client.ask(0)
        link: Any = served(client).client.link
        dialect, message = getattr(link, "dialect", None), getattr(link, "message", None)
    if dialect is None or not isinstance(message, bytes):
        return unexamined("the protocol has no encoding of its own")
    foreign = foreign_arrays(message, dialect)
    if not foreign:
        return kept("a reply has no array in a foreign encoding")
    own = dialect.encode(np.zeros(1))
    return broken(
        f"an array is a map with the keys {_keys(foreign[0])}",
        f"the keys {_keys(own)}",
        "This package reads every encoding; the clients of the protocol's authors read their own alone.",
    )


def _keys(array: Mapping[Any, Any]) -> str:
    return ", ".join(map(repr, array))


@rule("server/contract/seed", "must", needs=ANSWERS)
def seed(subject: ServerSubject) -> Finding:
    """Give the same query with the same seed the same answer."""
    if not subject.repeatable:
        return unexamined(NOT_REPEATABLE)
    if not subject.repeats:
        return broken(
            "the same first query of an episode got two different answers over one connection",
            "the same bytes for the same query and seed",
            "The server draws from a generator that goes on from request to request: seed it from the "
            "request, or declare repeatable=False.",
        )
    with subject.client() as client:
        first = client.ask(0)
        client.start()
        another = client.ask(0, seed=client.shown.query(0).seed ^ 0x5A5A)
    if first.tobytes() == another.tobytes():
        return kept("the same query gets the same answer, with another seed as well")
    return kept("the same query and seed get the same answer, another seed another one")
