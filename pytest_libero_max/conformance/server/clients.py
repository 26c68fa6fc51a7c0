"""Rules for clients of a server: answers, several at once, errors, pauses, connections that end."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from threading import Thread

from pytest_libero_max.conformance.policy.subject import QUERIES, PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.conformance.server.subject import ServerSubject, served
from pytest_libero_max.errors import ServerError, counted
from pytest_libero_max.policies.check import Actions

CONNECTS = "server/contract/connects"
ANSWERS = "server/contract/answers"

PAUSE_S = 3.0
"""Silence of a client that a server must bear, s; a simulator plays an arm in it."""

TOGETHER_S = 20.0
"""Longest time for two clients that ask at once, s, beyond what one takes."""


@rule(CONNECTS, "must")
def connects(subject: ServerSubject) -> Iterator[Finding]:
    """Accept a client, and greet it as the protocol asks."""
    with subject.client() as client:
        spec = client.policy.spec
        yield kept(f"{spec.name} (H={spec.horizon} Q={spec.query_interval})")


@rule(ANSWERS, "must", needs=CONNECTS)
def answers(subject: ServerSubject) -> Iterator[Finding]:
    """Answer every query of an episode without an interruption."""
    with subject.client() as client:
        for index in range(QUERIES):
            client.ask(index)
        interruptions = served(client).client.interruptions
    if interruptions == 0:
        yield kept(f"{counted(QUERIES, 'query', 'queries')} were answered")
        return
    yield broken(
        f"{counted(QUERIES, 'query', 'queries')} met {counted(interruptions, 'interruption')}",
        "no interruption",
        "Look at the server's own output.",
    )


@rule("server/contract/chunk", "should", needs=ANSWERS)
def chunk(subject: ServerSubject) -> Iterator[Finding]:
    """Return as many actions as the server or its profile declares."""
    with subject.client() as client:
        client.ask(0)
        returned, declared = served(client).returned, client.policy.spec.horizon
    if returned is None:
        yield unexamined("the number of actions in a reply is not known")
    elif returned == declared:
        yield kept(f"a reply has {counted(returned, 'action')}")
    else:
        yield broken(
            f"a reply has {counted(returned, 'action')}",
            f"horizon={declared}, as declared",
            "Declare the H that the model returns, or choose the profile of this checkpoint.",
        )


def _alone(subject: ServerSubject, indices: tuple[int, ...]) -> list[Actions]:
    with subject.client() as client:
        return [client.ask(index) for index in indices]


def _same(first: list[Actions], second: list[Actions]) -> bool:
    return [answer.tobytes() for answer in first] == [answer.tobytes() for answer in second]


@rule("server/clients/second", "must", needs=ANSWERS)
def second_client(subject: ServerSubject) -> Iterator[Finding]:
    """Answer a second client while a first one is connected."""
    began = time.monotonic()
    _alone(subject, (0,))
    limit = time.monotonic() - began + TOGETHER_S
    with subject.client() as first:
        first.ask(0)
        second = Thread(target=_ask_as_another, args=(subject,), daemon=True)
        second.start()
        second.join(limit)
        if second.is_alive():
            yield broken(
                f"a second client got no answer within {limit:.0f} s while a first one was connected",
                "an answer",
                "The server handles one connection at a time: handle each in a thread or task of its own. "
                "Runs with several workers open several.",
            )
            return
    yield kept("a second client is answered while a first one is connected")


@rule("server/clients/company", "must", needs="server/clients/second")
def company(subject: ServerSubject) -> Iterator[Finding]:
    """Give each client the answers to its own queries, whoever else asks."""
    if not subject.repeatable:
        yield unexamined("repeatable=False, so no two answers can be compared")
        return
    rows = ((0, 1), (2, 3))
    alone = [_alone(subject, row) for row in rows]
    with subject.client() as first, subject.client() as second:
        turns = [(first.ask(rows[0][turn]), second.ask(rows[1][turn])) for turn in (0, 1)]
    together = [[turn[number] for turn in turns] for number in (0, 1)]
    if all(_same(*pair) for pair in zip(alone, together, strict=True)):
        yield kept("two clients that ask in turn get the answers that each gets alone")
        return
    yield broken(
        "two clients that ask in turn get other answers than each alone",
        "the same bytes",
        "A queue, a history or a seed is shared by all connections: keep it with the connection.",
    )


@rule("server/clients/reconnects", "must", needs=ANSWERS)
def reconnects(subject: ServerSubject) -> Iterator[Finding]:
    """Answer a client that has connected again as before."""
    first, second = (_alone(subject, (0, 1)) for _ in range(2))
    if not subject.repeatable:
        yield kept("a client that has connected again is answered; repeatable=False, so not compared")
    elif _same(first, second):
        yield kept("a client that has connected again gets the same answers")
    else:
        yield broken(
            "a client that has connected again gets other answers",
            "the same bytes for the same queries of the same episode",
            "Something lives on from connection to connection: a generator, a queue, a count.",
        )


@rule("server/clients/leaves", "must", needs=ANSWERS)
def leaves_in_a_query(subject: ServerSubject) -> Iterator[Finding]:
    """Go on when a client has left in the middle of a query."""
    with subject.client() as leaving:
        thread = Thread(target=_ask_in_vain, args=(leaving,), daemon=True)
        thread.start()
        time.sleep(0.02)
    thread.join(TOGETHER_S)
    served(leaving).client.close()  # it may have connected again
    yield from _still_answers(subject, "a client left in the middle of a query")


def _ask_as_another(subject: ServerSubject) -> None:
    with suppress(ServerError):  # what is late is told by the time, not by the error
        _alone(subject, (1,))


def _ask_in_vain(client: PolicySubject) -> None:
    with suppress(Exception):  # its connection ends under it, which each protocol notices in its own way
        client.ask(0)


@rule("server/clients/idle", "should", needs=ANSWERS)
def idle(subject: ServerSubject) -> Iterator[Finding]:
    """Keep a connection over which nothing is asked for three seconds."""
    if subject.address.protocol.startswith("http"):
        yield unexamined("HTTP connections may end between two requests")
        return
    with subject.client() as client:
        client.ask(0)
        greeting = served(client).greeting
        time.sleep(PAUSE_S)
        client.ask(1)
        again = served(client).greeting is not greeting  # made anew by each connection
    if not again:
        yield kept(f"a client is answered after {PAUSE_S:g} s of silence")
        return
    yield broken(
        f"the connection of a client was lost after {PAUSE_S:g} s of silence",
        "an answer over the same connection",
        "A pair plays for minutes between some queries: lengthen the server's idle and ping timeouts.",
    )


@rule("server/errors/words", "should", needs=ANSWERS)
def errors_in_words(subject: ServerSubject) -> Iterator[Finding]:
    """Answer a request that lacks its inputs with an error in words."""
    error = _error_of_nonsense(subject)
    if error is None:
        yield broken(
            "a request without any input was answered with actions",
            "an error",
            "The model is not asked, or missing inputs are replaced by zeros.",
        )
    elif "reports an error" in error or "HTTP" in error:
        yield kept("a request without any input is answered with an error in words")
    else:
        yield broken(
            f"a request without any input: {error}",
            "an error in words",
            "Catch exceptions of the policy, and send their text: users otherwise see a lost connection.",
        )


@rule("server/errors/survives", "must", needs=ANSWERS)
def survives_errors(subject: ServerSubject) -> Iterator[Finding]:
    """Go on after a request that lacks its inputs."""
    _error_of_nonsense(subject)
    yield from _still_answers(subject, "a request without any input")


def _error_of_nonsense(subject: ServerSubject) -> str | None:
    """Return the error that a request without inputs ends with; None where it is answered."""
    with subject.client() as client:
        policy = served(client)
        try:
            policy.client.ask({}, policy.read)
        except ServerError as error:
            return str(error)
    return None


def _still_answers(subject: ServerSubject, after: str) -> Iterator[Finding]:
    try:
        _alone(subject, (0,))
    except ServerError as error:
        yield broken(
            f"after {after}: {error}".rstrip("."),
            "an answer to the next client",
            "One client must not take the server down: catch what a connection raises.",
        )
    else:
        yield kept(f"after {after}, the next client is answered")
