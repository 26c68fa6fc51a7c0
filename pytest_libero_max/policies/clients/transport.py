"""Client of a server: the connection that a protocol offers, the retries around it, and statuses of HTTP."""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from threading import Event, Timer
from typing import Any, Protocol, TypeVar
from urllib.parse import urljoin, urlsplit

from pytest_libero_max.errors import ServerError, counted
from pytest_libero_max.policies.clients.address import TOKEN_VARIABLE, Address, server_token
from pytest_libero_max.policies.clients.codecs import shortened
from pytest_libero_max.policies.clients.waiting import Wait, waiting

LOG = logging.getLogger("pytest_libero_max.servers")

FIRST_PAUSE_S = 0.25
LONGEST_PAUSE_S = 5.0

MOST_REDIRECTS = 3

_TOKENS = (401, 403, 407)
_NEVER = (*_TOKENS, 404, 405, 410, 426)
"""Statuses that the next request would get as well."""

_WAITING = (408, 425, 429, 502, 503, 504, *range(520, 531))
"""Statuses of servers that start, and of balancers before them."""

MOST_BAD_ANSWERS = 3
"""Number of errors or useless answers to a query after which the server is given up."""

Answer = TypeVar("Answer")


class Unreachable(ServerError):
    """No connection, a lost connection or no answer in time: worth waiting for."""


class NoConnection(Unreachable):
    """No connection was accepted: nothing was asked."""


class StaleConnection(Unreachable):
    """A connection was kept, and the server has closed it before a byte of the next answer."""


class Refused(ServerError):
    """The server is there, and asking it again would not help: a token, a path or a protocol is wrong."""


class OtherProtocol(Refused):
    """The server speaks another protocol, which the error names."""


def late(timeout_s: float, silence: str = "no answer came") -> Unreachable:
    """Return the error of an answer that did not come in time."""
    return Unreachable(f"{silence} within {timeout_s:g} s (?timeout=SECONDS changes that)")


def reported(error: object) -> ServerError:
    """Return the error of a server that says it has one."""
    return ServerError(f"the server reports an error: {shortened(str(error))}")


@contextmanager
def time_limit(connection: socket.socket, seconds: float) -> Iterator[None]:
    """Shut a connection down if the block takes longer, also where each part of it goes on in time."""
    over = Event()

    def end() -> None:
        over.set()
        with suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)

    timer = Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    except ServerError:
        if over.is_set():
            raise late(seconds) from None
        raise
    finally:
        timer.cancel()


class Link(Protocol):
    """One connection to a server, in one protocol. It is closed and opened again after every trouble."""

    def open(self) -> Any:
        """Connect and return the server's greeting; None where it sends none.

        Raises:
            Unreachable: No server answers there.
            ServerError: The server does not speak the protocol.
        """

    def ask(self, request: Any) -> Any:
        """Send a request and return the reply.

        Raises:
            Unreachable: The connection was lost, or no answer came in time.
            ServerError: The server reports an error, or its reply cannot be read.
        """

    def close(self) -> None:
        """Close the connection; nothing happens if it is closed."""


class Client:
    """Asks a server, patiently.

    A server that cannot be reached is waited for, with pauses that grow from 0.25 to 5 s, as long as the
    patience lasts. A server that answers with errors or nonsense is asked three times, and one that refuses
    before it has ever answered once. After it was given up it is asked once by each later query until it
    answers again. A connection that the server closed since its last answer is opened again at once, which is
    no interruption.

    Args:
        timeout_s: Longest time of the link for one answer, for messages; None where it is not known.

    Attributes:
        interruptions: Number of times that a query had to be asked again.
        on_open: Called with the server's greeting each time it is connected to.
        recognise: Returns a sentence about a server that speaks another protocol; None where it does not.
    """

    def __init__(
        self,
        name: str,
        link: Link,
        patience_s: float,
        sleep: Callable[[float], None] = time.sleep,
        timeout_s: float | None = None,
    ) -> None:
        self.interruptions = 0
        self.waited_s = 0.0
        self._name = name
        self.link = link
        self._patience_s = patience_s
        self.on_open: Callable[[Any], None] = lambda greeting: None
        self._sleep = sleep
        self._timeout_s = timeout_s
        self.recognise: Callable[[], str | None] = lambda: None
        self._is_open = False
        self._given_up = False
        self._has_answered = False

    def connect(self) -> None:
        """Connect, unless it is connected."""
        self._patiently(lambda: None)

    def ask(self, request: Any, read: Callable[[Any], Answer]) -> Answer:
        """Ask, and read the reply.

        Raises:
            ServerError: The server was given up; names the number of tries, the time they took, and the last
            error.
        """
        answer = self._patiently(lambda: read(self.link.ask(request)))
        self._has_answered = True
        return answer

    def close(self) -> None:
        """Close the connection."""
        self._is_open = False
        self.link.close()

    def _patiently(self, act: Callable[[], Answer]) -> Answer:
        with waiting(self._name, self._patience_s, self._timeout_s) as wait:
            return self._try(act, wait)

    def _try(self, act: Callable[[], Answer], wait: Wait) -> Answer:
        began = time.monotonic()
        pause, tries, bad = FIRST_PAUSE_S, 0, 0
        while True:
            tries += 1
            tried_at = time.monotonic()
            try:
                answer = self._once(act)
            except ServerError as error:
                self.close()
                self._require_worth_trying(error)
                bad += not isinstance(error, Unreachable | Refused)
                now = time.monotonic()
                took = now - began
                # Another try to connect would take as long as this one.
                next_s = pause + (now - tried_at if isinstance(error, NoConnection) else 0.0)
                if self._given_up or bad == MOST_BAD_ANSWERS or took + next_s > self._patience_s:
                    self._given_up = True
                    cure = (
                        "Start the server, or correct the address"
                        if isinstance(error, NoConnection)
                        else "Look at the server's own output"
                    )
                    raise ServerError(
                        f"{self._name}: {error}. It was tried {counted(tries, 'time')} in {took:.1f} s and "
                        f"given up. {cure}."
                    ) from error
                wait.why = str(error)
                LOG.warning("%s: %s; trying again in %.2f s", self._name, error, pause)
                self._sleep(pause)
                pause = min(2 * pause, LONGEST_PAUSE_S)
            except BaseException:
                self.close()  # a reply on its way must not answer the next query
                raise
            else:
                self._given_up = False
                if tries > 1:
                    self.interruptions += 1
                    self.waited_s += time.monotonic() - began
                return answer

    def _once(self, act: Callable[[], Answer]) -> Answer:
        """Open the connection where it is not open, and act; over a stale connection again over a new one."""
        if self._is_open:
            try:
                return act()
            except StaleConnection:
                self.close()
        self.on_open(self.link.open())
        self._is_open = True
        return act()

    def _require_worth_trying(self, error: ServerError) -> None:
        """Give up a server that has never answered, and refuses or speaks another protocol.

        One that has answered is waited for: a balancer, for example, may answer in the place of a server that
        is started again.
        """
        if self._has_answered or isinstance(error, NoConnection):
            return
        sentence = None if isinstance(error, OtherProtocol) else self.recognise()
        if sentence is not None or isinstance(error, Refused):
            self._given_up = True
            text = str(error).rstrip(".")
            end = "" if sentence is None else f" {sentence}"
            raise ServerError(f"{self._name}: {text}.{end}") from error


def status_error(status: int, reason: str, path: str, content: bytes, usual: str = "") -> ServerError:
    """Return the error of an answer that is none; ``usual``: what an address without a path stands for."""
    words = content.strip()
    body = "" if not words or words[:1] == b"<" else f": {shortened(words.decode('utf-8', 'replace'))}"
    text = f"HTTP status {status} {reason} for {path or '/'}{body}"
    if status in _TOKENS:
        given = server_token() is not None
        reason_shown = (
            f"The token in {TOKEN_VARIABLE} is not accepted"
            if given
            else f"Give the token in {TOKEN_VARIABLE}"
        )
        also = ", or the path of the address is another" if status == 403 else ""
        return Refused(f"{text}. {reason_shown}{also}")
    if status in _NEVER and usual not in ("", path):
        return Refused(
            f"{text}. An address without a path stands for {usual}: leave {path} out, or give the path of "
            "the policy or the port of its server"
        )
    if status in _NEVER:
        return Refused(f"{text}. Give the path of the policy in the address, or the port of its server")
    if 300 <= status < 400:
        return Refused(f"{text}. Give the address to which it sends")
    return Unreachable(text) if status in _WAITING else ServerError(text)


def redirected(address: Address, location: str | None, status: int) -> Address:
    """Return the address to which a server sends, which is on the same host."""
    here = f"{'https' if address.secure else 'http'}://{address.where}{address.path or '/'}"
    there = urljoin(here, location or "")
    try:
        parts = urlsplit(there)
        port = parts.port
    except ValueError:
        raise Refused(f"HTTP status {status} sends to {shortened(there)}, which is no address") from None
    secure = parts.scheme in ("https", "wss")
    what = f"HTTP status {status} sends to {shortened(there)}"
    if location is None or parts.scheme not in ("http", "https", "ws", "wss"):
        raise Refused(f"{what}, which is no address of a server")
    if parts.hostname != address.host.lower():
        raise Refused(
            f"{what}, on another host, to which neither observations nor a token are sent. Give that address "
            "if it is that of the policy"
        )
    if address.secure and not secure:
        raise Refused(f"{what}, which is not encrypted. Give that address if it is the server")
    return replace(
        address.over(address.protocol, secure),
        port=port or (443 if secure else 80),
        path=parts.path + (f"?{parts.query}" if parts.query else ""),
    )
