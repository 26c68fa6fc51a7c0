"""Rules for the clients of a server: several at once, pauses, ends, strangers, and unusual requests."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from functools import partial
from threading import Barrier, Event, Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.policy.determinism import MIXED_UP
from pytest_libero_max.conformance.policy.subject import QUERIES, PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.conformance.server.contract import ANSWERS
from pytest_libero_max.conformance.server.subject import (
    ServerSubject,
    alter_requests,
    is_in_words,
    same,
    served,
    still_answers,
)
from pytest_libero_max.errors import AdapterError, LiberoMaxError, ServerError, counted
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.policies.clients.connection import connect

PAUSE_S = 3.0
"""Silence of a client that a server must bear, s; a simulator plays an arm in it."""

TOGETHER_S = 20.0
"""Longest time for two clients that ask at once, s, beyond what one takes."""

VISIBLE_S = 0.1
"""Shortest query in which it is seen whether a ping is answered, s."""

SECOND, AT_ONCE = "server/clients/second", "server/clients/at-once"
LEAVES, STRANGER = "server/clients/leaves", "server/clients/stranger"


@rule(SECOND, "must", needs=ANSWERS)
def second_client(subject: ServerSubject) -> Finding:
    """Answer a second client while a first one is connected."""
    began = time.monotonic()
    subject.alone(0)
    limit = time.monotonic() - began + TOGETHER_S
    with subject.client() as first:
        first.ask(0)
        second = Thread(target=_ask_as_another, args=(subject,), daemon=True)
        second.start()
        second.join(limit)
        if second.is_alive():
            return broken(
                f"a second client got no answer within {limit:.0f} s while a first one was connected",
                "an answer",
                "The server handles one connection at a time: handle each in a thread or task of its own. "
                "Runs with several workers open several.",
            )
    return kept("a second client is answered while a first one is connected")


@rule("server/clients/company", "must", needs=SECOND)
def company(subject: ServerSubject) -> Finding:
    """Give each client the answers to its own queries, whoever else asks in turn."""
    if reason := subject.not_comparable():
        return reason
    rows = ((0, 1), (2, 3))
    alone = [subject.alone(*row) for row in rows]
    with subject.client() as first, subject.client() as second:
        turns = [(first.ask(rows[0][turn]), second.ask(rows[1][turn])) for turn in (0, 1)]
    together = [[turn[number] for turn in turns] for number in (0, 1)]
    if all(same(*pair) for pair in zip(alone, together, strict=True)):
        return kept("two clients that ask in turn get the answers that each gets alone")
    return broken(
        "two clients that ask in turn get other answers than each alone",
        "the same bytes",
        "A queue, a history or a seed is shared by all connections: keep it with the connection.",
    )


@rule(AT_ONCE, "must", needs="server/clients/company")
def at_once(subject: ServerSubject) -> Finding:
    """Give clients that ask at the same moment the answer that each gets alone."""
    answers = subject.once(_alone_and_at_once)
    if isinstance(answers, Finding):
        return answers
    if any(a.shape != b.shape or np.abs(a - b).max() > MIXED_UP for a, b in answers):
        return broken(
            f"{QUERIES} clients that ask at the same moment get other answers than each alone",
            "the answer that each query gets alone",
            "A batch is mixed up, or something is shared by queries that are computed together: keep each "
            "answer with its query.",
        )
    return kept(f"{QUERIES} clients that ask at the same moment get the answers of each alone")


@rule("server/clients/rounding", "note", needs=AT_ONCE)
def rounding(subject: ServerSubject) -> Finding:
    """Answer with the same bytes alone and in a batch."""
    answers = subject.once(_alone_and_at_once)
    if isinstance(answers, Finding):
        return answers
    if same(*map(list, zip(*answers, strict=True))):
        return kept("the same bytes alone and at the same moment as others")
    furthest = max(float(np.abs(a - b).max()) for a, b in answers)
    return broken(
        f"answers change by up to {furthest:.1g} when others ask at the same moment",
        "the same bytes alone and in a batch",
        "Serve it with --pad-batch, or without batches, or declare repeatable=False.",
    )


def _alone_and_at_once(subject: ServerSubject) -> Finding | list[tuple[Actions, Actions]]:
    """Return each query's answer alone, and when as many clients ask at the same moment, twice."""
    if reason := subject.not_comparable():
        return reason
    alone = [subject.alone(index)[0] for index in range(QUERIES)]
    pairs: list[tuple[Actions, Actions]] = []
    for _ in range(2):
        with ExitStack() as stack:
            clients = [stack.enter_context(subject.client()) for _ in range(QUERIES)]
            for before, answer in zip(alone, asked_together(clients), strict=True):
                if isinstance(answer, LiberoMaxError):
                    raise answer
                pairs.append((before, answer))
    return pairs


def asked_together(clients: list[PolicySubject]) -> list[Actions | LiberoMaxError]:
    """Return the answers, or errors, to query ``i`` of client ``i``, all asked at the same moment."""
    barrier, answers = Barrier(len(clients)), dict[int, Actions | LiberoMaxError]()

    def ask(index: int) -> None:
        barrier.wait()
        try:
            answers[index] = clients[index].ask(index)
        except LiberoMaxError as error:
            answers[index] = error

    threads = [Thread(target=ask, args=(index,), daemon=True) for index in range(len(clients))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [answers[index] for index in range(len(clients))]


@rule("server/clients/reconnects", "must", needs=ANSWERS)
def reconnects(subject: ServerSubject) -> Finding:
    """Answer a client that has connected again as before."""
    first, second = (subject.alone(0, 1) for _ in range(2))
    if reason := subject.not_comparable():
        return kept(f"a client that has connected again is answered; {reason.observed}")
    if same(first, second):
        return kept("a client that has connected again gets the same answers")
    return broken(
        "a client that has connected again gets other answers",
        "the same bytes for the same queries of the same episode",
        "Something lives on from connection to connection: a generator, a queue, a count.",
    )


@rule("server/clients/idle", "should", needs=ANSWERS)
def idle(subject: ServerSubject) -> Finding:
    """Keep a connection over which nothing is asked for three seconds."""
    if subject.address.protocol.startswith("http"):
        return unexamined("HTTP connections may end between two requests")
    with subject.client() as client:
        client.ask(0)
        greeting = served(client).greeting
        time.sleep(PAUSE_S)
        client.ask(1)
        lost = served(client).greeting is not greeting  # made anew by each connection
    if not lost:
        return kept(f"a client is answered after {PAUSE_S:g} s of silence")
    return broken(
        f"the connection of a client was lost after {PAUSE_S:g} s of silence",
        "an answer over the same connection",
        "A pair plays for minutes between some queries: lengthen the server's idle and ping timeouts.",
    )


@rule("server/clients/pings", "note", needs=ANSWERS)
def pings(subject: ServerSubject) -> Finding:
    """Answer pings while a query is computed."""
    with subject.client() as client:
        ping: Callable[[], Event] | None = getattr(served(client).client.link, "ping", None)
        if ping is None:
            return unexamined(f"{subject.address.protocol} has no pings")
        link = alter_requests(client)
        client.ask(0)
        request = link.request
        began = time.monotonic()
        ping().wait(TOGETHER_S)
        asked_at = time.monotonic()
        link.ask(request)
        query_s = time.monotonic() - asked_at
        if query_s < max(VISIBLE_S, 4 * (asked_at - began)):
            return unexamined(f"a query takes {1e3 * query_s:.0f} ms, too short to see a ping in it")
        answered = [_pinged(lambda: link.ask(request), ping, query_s) for _ in range(3)]
    if sum(answered) > 1:  # a busy machine may miss one
        return kept("a ping is answered while a query is computed")
    return broken(
        f"pings were not answered before the answer to a query of {query_s:.2f} s",
        "an answer while the query is computed",
        "The model computes in the event loop: run it in a thread. A client with the keepalive that "
        "websockets has by default (20 s) loses the connection in a longer query, such as one that compiles.",
    )


def _pinged(ask: Callable[[], Any], ping: Callable[[], Event], query_s: float) -> bool:
    """Return True if a ping within a query is answered before the query is."""
    thread = Thread(target=ask, daemon=True)
    thread.start()
    time.sleep(query_s / 4)
    in_time = ping().wait(query_s / 2) and thread.is_alive()  # a quarter is left
    thread.join()
    return in_time


@rule(LEAVES, "must", needs=ANSWERS)
def leaves_in_a_query(subject: ServerSubject) -> Finding:
    """Go on when a client has left in the middle of a query."""
    with subject.client() as leaving:
        thread = Thread(target=_ask_in_vain, args=(leaving,), daemon=True)
        thread.start()
        time.sleep(0.02)
    thread.join(TOGETHER_S)
    served(leaving).client.close()  # it may have connected again
    return still_answers(subject, "a client left in the middle of a query")


@rule(STRANGER, "must", needs=LEAVES)
def stranger(subject: ServerSubject) -> Finding:
    """Go on when something has connected that does not speak the protocol."""
    with suppress(OSError, ServerError), connect(subject.address) as connection:
        connection.sendall(b"\x00\xff of no protocol\r\n\r\n")
        connection.settimeout(0.2)
        connection.recv(1)
    return still_answers(subject, "a connection that sent bytes of no protocol")


def _ask_as_another(subject: ServerSubject) -> None:
    with suppress(ServerError):  # what is late is told by the time, not by the error
        subject.alone(1)


def _ask_in_vain(client: PolicySubject) -> None:
    with suppress(Exception):  # its connection ends under it, which each protocol notices in its own way
        client.ask(0)


LARGE_PX, SMALL_PX = 1024, 16

Array = NDArray[Any]


@rule("server/requests/large", "should", needs=STRANGER)
def large_images(subject: ServerSubject) -> Finding:
    """Answer a request with images of 1024 pixels, or refuse it in words."""
    return _with_images(
        subject,
        LARGE_PX,
        "Permit larger messages (websockets: max_size=None), in the server and in a proxy before it.",
    )


@rule("server/requests/small", "should", needs=STRANGER)
def small_images(subject: ServerSubject) -> Finding:
    """Answer a request with images of 16 pixels, or refuse it in words."""
    return _with_images(
        subject, SMALL_PX, "Resize images before they reach the model, or refuse other sizes in words."
    )


def _with_images(subject: ServerSubject, side: int, cure: str) -> Finding:
    """Return the finding of a request whose images have another size."""
    sizes: list[int] = []
    with subject.client() as client:
        alter_requests(client, partial(_resized, side=side, sizes=sizes))
        observation = {key: resized(value, side) for key, value in client.shown.copy(0).items()}
        try:
            try:
                client.ask(0)
                if not sizes:  # they are sent as files, which are made from the observation
                    client.ask(0, observation=observation)
            except AdapterError:
                return unexamined("the profile makes images of one size only")
            outcome = "is answered"
        except ServerError as error:
            outcome = str(error).rstrip(".")
            if not is_in_words(outcome):
                return broken(f"images of {side} pixels: {outcome}", "an answer, or an error in words", cure)
            outcome = "is refused in words"
    size = f" ({sum(sizes) / 1e6:.1f} MB)" if sizes else ""
    return kept(f"a request with images of {side} pixels{size} {outcome}")


def resized(array: Array, side: int) -> Array:
    """Return an image with about so many pixels a side, by repeating or leaving out; other arrays as is."""
    if array.ndim < 3 or array.shape[-1] != 3 or min(array.shape[-3:-1]) < 2:
        return array
    for axis in (-3, -2):
        count = array.shape[axis]
        array = np.take(array, np.arange(side) * count // side, axis=axis)
    return array


def _resized(request: Any, side: int, sizes: list[int]) -> Any:
    if isinstance(request, Mapping):
        return {key: _resized(value, side, sizes) for key, value in request.items()}
    if isinstance(request, list | tuple):
        return [_resized(value, side, sizes) for value in request]
    if isinstance(request, np.ndarray) and (array := resized(request, side)) is not request:
        sizes.append(array.nbytes)
        return array
    return request


@rule("server/errors/words", "should", needs=STRANGER)
def errors_in_words(subject: ServerSubject) -> Finding:
    """Answer a request that lacks its inputs with an error in words."""
    error = _error_of_nonsense(subject)
    if error is None:
        return broken(
            "a request without any input was answered with actions",
            "an error",
            "The model is not asked, or missing inputs are replaced by zeros.",
        )
    if is_in_words(error):
        return kept("a request without any input is answered with an error in words")
    return broken(
        f"a request without any input: {error}",
        "an error in words",
        "Catch exceptions of the policy, and send their text: users otherwise see a lost connection.",
    )


@rule("server/errors/survives", "must", needs=STRANGER)
def survives_errors(subject: ServerSubject) -> Finding:
    """Go on after a request that lacks its inputs."""
    _error_of_nonsense(subject)
    return still_answers(subject, "a request without any input")


@rule("server/errors/neighbours", "should", needs=AT_ONCE)
def spares_neighbours(subject: ServerSubject) -> Finding:
    """Answer clients that ask at the same moment as one whose request lacks its inputs."""
    try:
        subject.alone(0)
    except ServerError:
        return unexamined("the server does not answer any more")
    with ExitStack() as stack:
        clients = [stack.enter_context(subject.client()) for _ in range(QUERIES)]
        alter_requests(clients[0], _nonsense(subject))
        answers = asked_together(clients)[1:]
        asked_again = [served(client).client.interruptions > 0 for client in clients[1:]]
    met = sum(
        again or isinstance(answer, LiberoMaxError)
        for again, answer in zip(asked_again, answers, strict=True)
    )
    if not met:
        return kept(f"{counted(len(answers), 'client')} beside one without inputs are answered")
    return broken(
        f"{met} of {counted(len(answers), 'client')} that asked beside one without inputs met an error",
        "an error for that client alone",
        "A batch fails as a whole: check requests before they are batched, or compute them again alone.",
    )


def _error_of_nonsense(subject: ServerSubject) -> str | None:
    """Return the error that a request without inputs ends with; None where it is answered."""
    with subject.client() as client:
        alter_requests(client, _nonsense(subject))
        try:
            client.ask(0)
        except ServerError as error:
            return str(error)
    return None


def _nonsense(subject: ServerSubject) -> Callable[[Any], Any]:
    """Return a function that takes the inputs out of a request."""
    fixed = set(_literals(subject.profile.tables.get("request", {})))

    def keeps(value: Any) -> bool:
        return not isinstance(value, np.ndarray | bytes | str) or (isinstance(value, str) and value in fixed)

    return partial(_without, keeps=keeps)


def _without(value: Any, keeps: Callable[[Any], bool]) -> Any:
    if isinstance(value, Mapping):
        return {key: _without(item, keeps) for key, item in value.items() if keeps(item)}
    if isinstance(value, list | tuple):
        return [_without(item, keeps) for item in value if keeps(item)]
    return value


def _literals(layout: Any) -> Iterator[str]:
    """Yield the texts of a profile's request that are no inputs, for example the type of a message."""
    if isinstance(layout, Mapping | list):
        for value in layout.values() if isinstance(layout, Mapping) else layout:
            yield from _literals(value)
    elif isinstance(layout, str) and layout[:1] != "$":
        yield layout
