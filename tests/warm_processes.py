"""Processes of Python that begin with everything imported.

A session that a test starts in a process of its own, and each worker of it, would spend two thirds of their
time on imports. ``tests/warm_server.py`` forks them from a process that has done nothing else. What it cannot
start as it was asked is started as usual, and so is everything where the system has no ``pidfd_open``.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from inspect import signature
from pathlib import Path
from socket import socket
from types import FunctionType, SimpleNamespace
from typing import Any

from _pytest import pytester
from execnet import gateway_io
from execnet.gateway_base import ExecModel

from pytest_libero_max.runs import run_verification
from tests.warm_client import read, requested, start

address = ""
"""Path of the server's socket, in a process that the server has forked."""

PYTHON = sys.executable

ROOT = Path(__file__).parents[1]

_PLAIN: Any = subprocess.Popen

_STREAMS = ("p2cread", "c2pwrite", "errwrite")
"""Standard streams of a new process, in the words of :class:`subprocess.Popen`."""

_UNUSUAL = ("executable", "preexec_fn", "pass_fds", "shell", "start_new_session")
"""Arguments that the server does not know."""


class WarmProcess(subprocess.Popen[Any]):
    """A process as of :class:`subprocess.Popen`, forked by the server where that is possible."""

    _connection: socket | None = None
    """To the server, which says there how the process ended."""

    def _execute_child(self, *given: Any) -> None:
        asked = signature(_PLAIN._execute_child).bind(self, *given).arguments
        started = None if any(asked[name] for name in _UNUSUAL) else self._forked(asked)
        if started is None:
            _PLAIN._execute_child(self, *given)
            return
        self.pid, self._connection = started
        ends = ("p2cread", "p2cwrite", "c2pread", "c2pwrite", "errread", "errwrite")
        _PLAIN._close_pipe_fds(self, *(asked[name] for name in ends))

    def _forked(self, asked: dict[str, Any]) -> tuple[int, socket] | None:
        words = asked["args"]
        if isinstance(words, str | bytes | os.PathLike) or str(words[0]) != PYTHON:
            return None
        environment = os.environ if asked["env"] is None else asked["env"]
        request = requested(
            [str(word) for word in words[1:]], environment, os.path.abspath(asked["cwd"] or "")
        )
        path = address or _server()
        if request is None or not path:
            return None
        streams = [number if asked[name] == -1 else asked[name] for number, name in enumerate(_STREAMS)]
        return start(path, request, streams)

    def _wait(self, timeout: float | None) -> int | None:
        if self._connection is None:
            status: int | None = _PLAIN._wait(self, timeout)
            return status
        if self.returncode is None:
            self._connection.settimeout(timeout)
            try:
                self.returncode = read(self._connection)
            except (TimeoutError, BlockingIOError):
                raise subprocess.TimeoutExpired(self.args, timeout or 0) from None
            self._connection.close()
        return self.returncode

    def _internal_poll(self, *given: Any, **named: Any) -> int | None:
        if self._connection is None:
            status: int | None = _PLAIN._internal_poll(self, *given, **named)
            return status
        with suppress(subprocess.TimeoutExpired):
            self._wait(0)
        return self.returncode


def _subprocess() -> SimpleNamespace:
    """Return a module like :mod:`subprocess` whose processes are :class:`WarmProcess`."""
    names = {**vars(subprocess), "Popen": WarmProcess}
    plain: Any = subprocess.run
    run = FunctionType(plain.__code__, names, "run", plain.__defaults__, plain.__closure__)
    run.__kwdefaults__ = plain.__kwdefaults__
    return SimpleNamespace(**{**names, "run": run})


SUBPROCESS = _subprocess()


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
    command = [PYTHON, "-m", "tests.warm_server", str(path)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, cwd=ROOT, env=environment)
    atexit.register(process.__exit__, None, None, None)
    while not path.exists():
        if process.poll() is not None:
            raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}.")
        time.sleep(0.02)
    return str(path)


def python_program(path: Path) -> str:
    """Write a program that shells may start for the interpreter, and return its path."""
    server = address or _server()
    lines = (
        f"#!{PYTHON} -IS",
        "import sys",
        f"sys.path.insert(0, {str(ROOT)!r})",
        "from tests.warm_client import be_python",
        f"be_python({server!r}, {PYTHON!r})",
    )
    path.write_text("\n".join(lines) + "\n")
    path.chmod(0o755)
    return str(path)


class KeptModules(pytester.SysModulesSnapshot):
    """Modules as they were, and those of packages and of the project that were imported since.

    Pytester forgets these, so that each session in this process would import them again, and open the display
    of EGL again.
    """

    def __init__(self, preserve: object = None) -> None:
        super().__init__(_is_installed)


def _is_installed(name: str) -> bool:
    file = getattr(sys.modules[name], "__file__", None)
    return file is not None and file.startswith(_INSTALLED)


_INSTALLED = tuple(f"{place}{os.sep}" for place in (ROOT, sys.prefix, sys.base_prefix))


def use_server() -> None:
    """Let pytest's fixture ``pytester``, execnet for its workers, and the package fork their processes."""
    for module in (pytester, run_verification):
        vars(module)["subprocess"] = SUBPROCESS
    vars(pytester)["SysModulesSnapshot"] = KeptModules
    gateway_io.Popen2IOMaster.__init__ = _begin_worker  # type: ignore[method-assign]


def _begin_worker(self: gateway_io.Popen2IOMaster, args: Sequence[str], execmodel: ExecModel) -> None:
    self.popen = WarmProcess(args, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    super(gateway_io.Popen2IOMaster, self).__init__(self.popen.stdin, self.popen.stdout, execmodel=execmodel)
