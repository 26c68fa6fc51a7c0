"""A sound server and a fitting profile for each protocol, and what may stand before a server."""

from __future__ import annotations

import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pytest_libero_max.policies.clients.codecs import MSGPACK_NUMPY
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.clients.served import ServedPolicy
from tests.policies.clients import fakes

CERTIFICATE = Path(__file__).with_name("certificate.pem")
"""Certificate for localhost, 127.0.0.1 and ::1 with its key, made for these tests and trusted by nothing."""

ROWS = [[0.0] * 6 + [-1.0]] * 16


@dataclass(frozen=True)
class Each:
    """One protocol.

    Attributes:
        profile: A profile for it.
        serve: Serves answers that can be played; yields the port.
        secure: Scheme of its addresses with TLS; None where there is none.
        cadence: H and Q where the profile does not say.
    """

    profile: str
    serve: Callable[[], AbstractContextManager[int]]
    secure: str | None
    cadence: tuple[int | None, int | None] = (None, None)

    def open(self, address: str) -> ServedPolicy:
        policy = load_served(address, self.profile, *self.cadence)
        policy.reset(fakes.EPISODE)
        return policy


def gr00t_reply(request: Any) -> Any:
    if request["endpoint"] == "ping":
        return {"status": "ok"}
    names = ("x", "y", "z", "roll", "pitch", "yaw", "gripper")
    return [{f"action.{name}": np.zeros((1, 16, 1), np.float32) for name in names}, {}]


def starvla_reply(request: Any) -> Any:
    """Reply in starVLA's envelope, also to a ping."""
    if "type" not in request:
        return {"ok": False, "status": "error", "request_id": "-", "error": {"message": "no `examples`"}}
    data = {} if request["type"] == "ping" else {"data": {"actions": np.array(ROWS)[None]}}
    return {"ok": True, "status": "ok", "type": request["type"], "request_id": "-", **data}


EACH: Mapping[str, Each] = {
    "openpi": Each("pi05_libero", lambda: fakes.openpi(lambda request: {"actions": ROWS}), "openpi+tls"),
    "vla-eval": Each("vla_eval_pi05", lambda: fakes.vla_eval(lambda request: np.array(ROWS)), "vla-eval+tls"),
    "starvla": Each("starvla", lambda: fakes.openpi(starvla_reply), "starvla+tls", (8, 4)),
    "gr00t": Each("gr00t_n17", lambda: fakes.zeromq(gr00t_reply, MSGPACK_NUMPY), None),
    "http": Each("dm05", lambda: fakes.http(lambda request: {"actions": ROWS}), "https"),
}


def ask(policy: ServedPolicy, index: int = 0) -> Any:
    return policy.predict(fakes.observation(), fakes.query(index))


@contextmanager
def accepting(
    talk: Callable[[socket.socket], None], host: str = "127.0.0.1", tls: bool = False
) -> Iterator[int]:
    """A TCP server that handles each connection in a thread; yields the port."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(CERTIFICATE)

    def one(connection: socket.socket) -> None:
        with suppress(OSError), connection:
            if not tls:
                talk(connection)
                return
            with context.wrap_socket(connection, server_side=True) as secured:
                talk(secured)

    def accept() -> None:
        with suppress(OSError):
            while True:
                connection, _ = server.accept()
                threading.Thread(target=one, args=(connection,), daemon=True).start()

    with socket.create_server((host, 0), family=family) as server:
        threading.Thread(target=accept, daemon=True).start()
        try:
            yield server.getsockname()[1]
        finally:
            with suppress(OSError):
                server.shutdown(socket.SHUT_RDWR)


def forwarded(
    port: int, host: str = "127.0.0.1", tls: bool = False, silent_s: float = 0.0
) -> AbstractContextManager[int]:
    """A balancer before a server: at another address, with TLS, or silent at first."""

    def talk(connection: socket.socket) -> None:
        time.sleep(silent_s)
        forward(connection, port)

    return accepting(talk, host, tls)


def forward(connection: socket.socket, port: int) -> None:
    """Carry bytes between a connection and a port of this machine until one of them ends."""
    with socket.create_connection(("127.0.0.1", port)) as inner:
        threading.Thread(target=_pump, args=(inner, connection), daemon=True).start()
        _pump(connection, inner)


def _pump(source: socket.socket, target: socket.socket) -> None:
    with suppress(OSError):
        while data := source.recv(2**16):
            target.sendall(data)
    with suppress(OSError):
        target.shutdown(socket.SHUT_RDWR)
