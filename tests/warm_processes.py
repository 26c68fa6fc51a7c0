"""Processes of Python that begin with everything imported.

A session that a test starts in a process of its own, and each worker of it, would spend two thirds of their
time on imports. ``tests/warm_server.py`` forks them from a process that has done nothing else. What it cannot
start as it was asked is started as usual, and so is everything where the system has no ``pidfd_open``.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any

from _pytest import pytester
from execnet import gateway_io
from execnet.gateway_base import ExecModel

address = ""
"""Path of the server's socket, in a process that the server has forked."""


@dataclass(frozen=True)
class Request:
    """How an interpreter is started: with ``code`` or, where there is none, with pytest."""

    code: str
    arguments: list[str]
    folder: str
    environment: dict[str, str]


class WarmProcess(subprocess.Popen[bytes]):
    """A process that the server forked, with what its users need of its base, which is for children.

    Args:
        connection: To the server, which says there how the process ended.
        pid: Its number.
        streams: Our ends of its input, output and errors.
    """

    def __init__(self, connection: socket.socket, pid: int, streams: Sequence[IO[bytes] | None]) -> None:
        self._child_created = False  # what the base asks when the object is collected
        self._connection = connection
        self.pid = pid
        self.stdin, self.stdout, self.stderr = streams
        self.returncode = None

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status, negative for a signal.

        Raises:
            subprocess.TimeoutExpired: It does not end in time.
        """
        if self.returncode is None:
            self._connection.settimeout(timeout)
            try:
                self.returncode = _read(self._connection)
            except (TimeoutError, BlockingIOError):
                raise subprocess.TimeoutExpired(str(self.pid), timeout or 0) from None
            self._connection.close()
        return self.returncode

    def poll(self) -> int | None:
        """Return the exit status; None while the process runs."""
        with suppress(subprocess.TimeoutExpired):
            return self.wait(0)
        return None

    def kill(self) -> None:
        """End the process, if it has not ended."""
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)


def popen(words: Sequence[str | os.PathLike[str]], **how: Any) -> subprocess.Popen[bytes]:
    """Start a process as :class:`subprocess.Popen` does, from the server where that is possible."""
    path = address or _server()
    request = _request(words, how.get("env"))
    if not path or request is None or not how.keys() <= {"stdin", "stdout", "stderr", "env", "close_fds"}:
        return subprocess.Popen(words, **how)
    own, given = zip(*(_ends(number, how.get(name)) for number, name in enumerate(_STREAMS)), strict=True)
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(path)
    _send(connection, request, given)
    for stream, number in zip(own, given, strict=True):
        if stream is not None:
            os.close(number)
    pid = _read(connection)
    if pid:
        return WarmProcess(connection, pid, own)
    for stream in (connection, *filter(None, own)):
        stream.close()
    return subprocess.Popen(words, **how)


_STREAMS = ("stdin", "stdout", "stderr")


def _request(
    words: Sequence[str | os.PathLike[str]], environment: Mapping[str, str] | None
) -> Request | None:
    """Return what a command asks for; None unless it starts this Python with code or with pytest."""
    python, *rest = (str(word) for word in words)
    if rest[:1] == ["-u"]:
        rest = rest[1:]
    if rest[:2] == ["-m", "pytest"]:
        rest = ["-mpytest", *rest[2:]]
    if python != sys.executable or rest[:1] not in (["-c"], ["-mpytest"]):
        return None
    env = dict(os.environ if environment is None else environment)
    code, arguments = (rest[1], rest[2:]) if rest[0] == "-c" else ("", rest[1:])
    return Request(code, arguments, os.getcwd(), env)


def _ends(number: int, stream: Any) -> tuple[IO[bytes] | None, int]:
    """Return our end of a stream, where a pipe is asked for, and the number of the other one."""
    if stream == subprocess.PIPE:
        read, write = os.pipe()
        return (open(write, "wb"), read) if number == 0 else (open(read, "rb"), write)
    if stream is None:
        return None, number
    return None, stream if isinstance(stream, int) else stream.fileno()


@cache
def _server() -> str:
    """Start the server of this process, and return its address; empty where there can be none."""
    try:
        os.close(os.pidfd_open(os.getpid()))
    except (AttributeError, OSError):  # not Linux, or a container that does not allow it
        return ""
    folder = tempfile.mkdtemp(prefix="warm-")  # the path of a socket has to be short
    path = Path(folder, "socket")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [sys.executable, "-m", "tests.warm_server", str(path)]
    root = Path(__file__).parents[1]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, cwd=root, env=environment)
    atexit.register(process.__exit__, None, None, None)
    while not path.exists():
        if process.poll() is not None:
            raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}.")
        time.sleep(0.02)
    return str(path)


def _send(connection: socket.socket, request: Request, streams: Sequence[int]) -> None:
    content = json.dumps(asdict(request)).encode()  # names that are not UTF-8 are escaped
    socket.send_fds(connection, [len(content).to_bytes(8, "big")], streams)
    connection.sendall(content)


def receive(connection: socket.socket) -> tuple[Request, list[int]]:
    """Return a request, and the numbers of its standard streams in this process."""
    size, streams, _, _ = socket.recv_fds(connection, 8, len(_STREAMS))
    with connection.makefile("rb") as file:
        content = file.read(int.from_bytes(size, "big"))
    return Request(**json.loads(content)), list(streams)


def reply(connection: socket.socket, number: int) -> None:
    """Send a number, to one who may be gone."""
    with suppress(OSError):
        connection.sendall(number.to_bytes(8, "big", signed=True))


def _read(connection: socket.socket) -> int:
    return int.from_bytes(connection.recv(8), "big", signed=True)


def use_server() -> None:
    """Let pytest's fixture ``pytester``, and execnet for its workers, start processes with :func:`popen`."""
    vars(pytester)["subprocess"] = SimpleNamespace(**{**vars(subprocess), "Popen": popen})
    gateway_io.Popen2IOMaster.__init__ = _begin_worker  # type: ignore[method-assign]


def _begin_worker(self: gateway_io.Popen2IOMaster, args: Sequence[str], execmodel: ExecModel) -> None:
    self.popen = popen(args, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    super(gateway_io.Popen2IOMaster, self).__init__(self.popen.stdin, self.popen.stdout, execmodel=execmodel)
