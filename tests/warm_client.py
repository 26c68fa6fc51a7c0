"""Requests to ``tests/warm_server.py`` for a process, and the way in which they are sent.

A program that has imported nothing else speaks it as well, so that what a shell starts is forked, too:
:func:`be_python` is all that the interpreter of :func:`tests.warm_processes.python_program` does.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple


class Request(NamedTuple):
    """Start of an interpreter: with ``code`` or, where there is none, with a module."""

    code: str
    module: str
    arguments: list[str]
    folder: str
    environment: dict[str, str]
    own_folder: bool
    """True if modules are found in the folder that it is started in."""


def requested(words: Sequence[str], environment: Mapping[str, str], folder: str) -> Request | None:
    """Return what the words behind an interpreter ask for; None unless they are code or a module."""
    rest, options = list(words), set[str]()
    while rest[:1] in (["-u"], ["-P"]):
        options.add(rest.pop(0))
    if rest[:1] and rest[0][:2] == "-m" and rest[0] != "-m":
        rest[:1] = ["-m", rest[0][2:]]
    if len(rest) < 2 or rest[0] not in ("-c", "-m"):
        return None
    code, module = (rest[1], "") if rest[0] == "-c" else ("", rest[1])
    return Request(code, module, rest[2:], folder, dict(environment), "-P" not in options)


def start(address: str, request: Request, streams: Sequence[int]) -> tuple[int, socket.socket] | None:
    """Let the server fork a process.

    Args:
        address: Path of the server's socket.
        request: How the process goes on.
        streams: Its input, output and errors.

    Returns:
        Its number, and the connection that says how it ended; None where the server cannot start it so.
    """
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(address)
    content = json.dumps(request).encode()  # names that are not UTF-8 are escaped
    socket.send_fds(connection, [len(content).to_bytes(8, "big")], streams)
    connection.sendall(content)
    if pid := read(connection):
        return pid, connection
    connection.close()
    return None


def receive(connection: socket.socket) -> tuple[Request, list[int]]:
    """Return a request, and the numbers of its standard streams in this process."""
    size, streams, _, _ = socket.recv_fds(connection, 8, 3)
    with connection.makefile("rb") as file:
        content: list[Any] = json.loads(file.read(int.from_bytes(size, "big")))
    return Request(*content), list(streams)


def reply(connection: socket.socket, number: int) -> None:
    """Send a number, to one who may be gone."""
    with suppress(OSError):
        connection.sendall(number.to_bytes(8, "big", signed=True))


def read(connection: socket.socket) -> int:
    """Return a number that :func:`reply` has sent; 0 where the server has ended."""
    return int.from_bytes(connection.recv(8), "big", signed=True)


def be_python(address: str, python: str) -> None:
    """Do what an interpreter does with the arguments of this process, and end as it ends.

    Args:
        address: Path of the server's socket; empty where there is none.
        python: Path of the interpreter.
    """
    request = requested(sys.argv[1:], os.environ, os.getcwd()) if address else None
    started = None if request is None else start(address, request, (0, 1, 2))
    if started is None:
        os.execv(python, [python, *sys.argv[1:]])
    pid, connection = started

    def pass_on(number: int, _: object) -> None:
        os.kill(pid, number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, pass_on)
    status = read(connection)
    if status < 0:
        signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    sys.exit(status)
