"""Writes the page of pairings: every client at every server, published servers among them.

    python -m tests.policies.peers.pairings > reports/pairings.md

The servers of openpi and vla-eval are their own programs (see ``.ci/peers.txt``); those of starVLA, GR00T and
HTTP are servers of the tests, which send what the published ones send.
"""

from __future__ import annotations

import socket
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version

from tests.policies.clients.each_protocol import EACH
from tests.policies.clients.pairings import SERVERS, Server, first_line
from tests.policies.peers.conftest import peer

PUBLISHED: Mapping[str, Server] = {
    "openpi": replace(SERVERS["openpi"], serve=lambda: peer("openpi_server.py")),
    "vla-eval": replace(SERVERS["vla-eval"], serve=lambda: peer("vla_eval_server.py", "reach", "8")),
}
"""Servers whose own programs are installed for the tests."""

_PACKAGES = {"openpi": "rlinf-openpi", "vla-eval": "vla-eval"}

_HEAD = """# Clients at servers of other protocols

Where an address names one protocol and a server of another one is there, a run or `libero-max check` says so
within 5 s, and in most cases names the address to write instead. The table has the first line that it prints,
without the address before it, and the time until then.

`PORT` is the server's. A server with a version is the published program; the others are those of the tests,
which send what the published ones send.

Written by `python -m tests.policies.peers.pairings > reports/pairings.md`, on a machine that did other work.
Tests expect every line within 5 s.

| Asked as | Server | First line | Seconds |
| --- | --- | --- | --- |"""


def nothing() -> int:
    """Return a port at which nothing listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def row(client: str, server: str, port: int, path: str = "") -> str:
    line, took_s = first_line(client, port, path)
    return f"| `{client}://` | {server} | {line or 'answers'} | {took_s:.1f} |"


def main() -> None:
    print(_HEAD)
    for name, kind in SERVERS.items():
        kind = PUBLISHED.get(name, kind)
        title = f"{name} {version(_PACKAGES[name])}" if name in _PACKAGES else name
        with kind.serve() as port:
            for client in EACH:
                print(row(client, title, port, kind.path), flush=True)
    for client in EACH:
        print(row(client, "nothing", nothing(), "?patience=3"))


if __name__ == "__main__":
    main()
