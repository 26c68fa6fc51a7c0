"""Each client at each server: what is said first, and after how many seconds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

import numpy as np

from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from tests.policies.clients import fakes
from tests.policies.clients.each_protocol import EACH, ask, forwarded, starvla_reply

Serve = Callable[[], AbstractContextManager[int]]


@dataclass(frozen=True)
class Server:
    """One kind of server.

    Attributes:
        serve: Serves; yields the port.
        speaks: Clients that it answers.
        named: What the others are told to write.
        path: Of its address.
    """

    serve: Serve
    speaks: tuple[str, ...]
    named: str
    path: str = ""


class Still:
    """An adapter that holds still."""

    spec = PolicySpec("still", 10, 5, cameras=())

    def reset(self, episode: object) -> None:
        pass

    def predict(self, observation: object, query: object) -> object:
        return np.zeros((10, 7))


@contextmanager
def served() -> Iterator[int]:
    with serving(Host(Still(), "x"), port=0) as (port, _):  # type: ignore[arg-type]
        yield port


@contextmanager
def behind_tls() -> Iterator[int]:
    with EACH["openpi"].serve() as port, forwarded(port, tls=True) as outer:
        yield outer


@contextmanager
def starvla() -> Iterator[int]:
    with fakes.openpi(starvla_reply, {"env": "starvla_policy_server", "action_chunk_size": 8}) as port:
        yield port


SERVERS: Mapping[str, Server] = {
    "openpi": Server(EACH["openpi"].serve, ("openpi",), "openpi://127.0.0.1:PORT"),
    "vla-eval": Server(EACH["vla-eval"].serve, ("vla-eval",), "vla-eval://127.0.0.1:PORT"),
    "starVLA": Server(starvla, ("starvla",), "starvla://127.0.0.1:PORT"),
    "starVLA's family, whose greeting says nothing": Server(
        EACH["starvla"].serve, ("starvla",), "starvla://127.0.0.1:PORT"
    ),
    "GR00T": Server(EACH["gr00t"].serve, ("gr00t",), "gr00t://127.0.0.1:PORT"),
    "HTTP": Server(EACH["http"].serve, ("http",), "http://127.0.0.1:PORT"),
    "libero-max serve": Server(served, (), "--libero-max-profile=served"),
    "libero-max serve, at /vla-eval": Server(
        served, ("vla-eval",), "vla-eval://127.0.0.1:PORT/vla-eval", "/vla-eval"
    ),
    "openpi with TLS": Server(behind_tls, (), "server with TLS"),
}


def first_line(client: str, port: int, path: str = "") -> tuple[str | None, float]:
    """What a client says first at a server, with PORT for the port, and after how many seconds."""
    address = f"{client}://127.0.0.1:{port}{path}"  # the path may be options
    began = time.monotonic()
    policy = None
    try:
        policy = EACH[client].open(address)
        ask(policy)
    except LiberoMaxError as error:
        text = str(error).removeprefix(f"policy server {address.partition('?')[0]}: ")
        return text.replace(f":{port}", ":PORT"), time.monotonic() - began
    finally:
        if policy is not None:
            policy.client.close()
    return None, time.monotonic() - began
