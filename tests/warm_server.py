"""Starts Python processes that have imported everything already.

``python -m tests.warm_server SOCKET`` imports what a session of pytest imports, and then forks a process for
each request that comes to ``SOCKET``. The process goes on as an interpreter that was started with the
arguments, environment, folder and standard streams of the request, and it ends as one. The server itself ends
with the process that holds the other end of its standard input.
"""

from __future__ import annotations

import gc
import importlib
import os
import runpy
import selectors
import shutil
import signal
import site
import socket
import sys
import types
from collections.abc import Mapping, Sequence

import xdist
from xdist import workermanage

from pytest_libero_max.worlds import threads
from tests import warm_processes
from tests.warm_client import Request, receive, reply

IMPORTED = (
    "cv2",
    "execnet.gateway",
    "mujoco",
    "pdb",
    "pytest_libero_max.benchmark.sampling",
    "pytest_libero_max.evaluation.evaluate",
    "pytest_libero_max.pairing.runner",
    "pytest_libero_max.pairing.trace",
    "pytest_libero_max.plugin.controller",
    "pytest_libero_max.plugin.hooks",
    "pytest_libero_max.report.comparison.compare",
    "pytest_libero_max.plugin.run_pair",
    "pytest_libero_max.policies.clients.fleet",
    "pytest_libero_max.policies.loading",
    "pytest_libero_max.report.gate_results",
    "pytest_libero_max.report.gate_text",
    "pytest_libero_max.report.writers.report_files",
    "pytest_libero_max.report.writers.summary",
    "pytest_libero_max.runs.run_verification",
    "pytest_libero_max.substrates.embedded",
    "pytest_libero_max.substrates.tiny",
    "pytest_libero_max.substrates.tiny.world",
    "pytest_libero_max.tasks.suites",
    "scipy.optimize.elementwise",
    "scipy.special",
    "xml.etree.ElementTree",
)

READ_AT_START = ("PYTHON", "MUJOCO", "PYOPENGL", "OPENBLAS", "OMP_", "MKL_", "LD_", "LC_", "LANG", "MALLOC")
"""How the names of variables begin that an interpreter or a module reads when it starts."""


def requests(path: str, before: Mapping[str, str]) -> Request:
    """Fork for each request.

    Returns:
        The request, in the process that was forked for it.
    """
    running: dict[int, tuple[int, socket.socket]] = {}
    with socket.socket(socket.AF_UNIX) as listener, selectors.DefaultSelector() as events:
        listener.bind(f"{path}.new")
        listener.listen(64)
        os.rename(f"{path}.new", path)  # whoever finds it may connect
        events.register(listener, selectors.EVENT_READ)
        events.register(0, selectors.EVENT_READ)
        while True:
            for key, _ in events.select():
                if key.fd == 0:
                    shutil.rmtree(os.path.dirname(path))
                    raise SystemExit
                if key.fd in running:
                    events.unregister(key.fd)
                    _ended(key.fd, *running.pop(key.fd))
                    continue
                connection, _ = listener.accept()
                request, streams = receive(connection)
                process = os.fork() if _same_start(request.environment, before) else None
                if process == 0:
                    _take(streams)
                    for handle, (_, other) in running.items():
                        os.close(handle)
                        other.close()
                    connection.close()
                    return request
                for stream in streams:
                    os.close(stream)
                reply(connection, process or 0)
                if process is None:
                    connection.close()
                    continue
                handle = os.pidfd_open(process)
                running[handle] = process, connection
                events.register(handle, selectors.EVENT_READ)


def _take(streams: Sequence[int]) -> None:
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)


def _same_start(environment: Mapping[str, str], before: Mapping[str, str]) -> bool:
    """Return whether an interpreter with this environment would have come to where this one is."""
    names = {name for name in (*environment, *before) if name.startswith(READ_AT_START)}
    names -= {"PYTHONPATH", "PYTHONIOENCODING"}  # go_on() does what they say
    if environment.get("OPENBLAS_NUM_THREADS") == "1":
        names.discard("OPENBLAS_NUM_THREADS")
    if not site.ENABLE_USER_SITE:
        names.discard("PYTHONUSERBASE")
    return all(environment.get(name) in (before.get(name), os.environ.get(name)) for name in names)


def _ended(handle: int, process: int, connection: socket.socket) -> None:
    _, status = os.waitpid(process, 0)
    os.close(handle)
    with connection:
        reply(connection, os.waitstatus_to_exitcode(status))


def go_on(request: Request, installed: list[str]) -> None:
    """Run what the arguments of an interpreter say.

    Args:
        request: What was asked for.
        installed: Entries of ``sys.path`` of an interpreter that was started in no folder.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.chdir(request.folder)
    os.environ.clear()
    os.environ.update(request.environment)
    for name in [name for name in sys.modules if name.split(".")[0] == "tests"]:
        del sys.modules[name]  # a session may have a package of this name
    first = [("" if request.code else request.folder)] if request.own_folder else []
    own = filter(None, request.environment.get("PYTHONPATH", "").split(os.pathsep))
    sys.path[:] = dict.fromkeys([*first, *own, *installed])
    workermanage._sys_path = list(sys.path)  # it keeps what it was imported with
    if os.environ.get("OPENBLAS_NUM_THREADS") == "1":
        threads.use_one_blas_thread()
    encoding, _, errors = request.environment.get("PYTHONIOENCODING", "").partition(":")
    if encoding or os.isatty(1):
        # Not reconfigure(), which takes it to be as seekable as the server's own was.
        lines = 1 if os.isatty(1) else -1
        sys.stdout = open(1, "w", lines, encoding or None, errors or None, closefd=False)  # noqa: SIM115
    sys.argv[:] = ["-c" if request.code else "-m", *request.arguments]
    if request.code:
        main = sys.modules["__main__"] = types.ModuleType("__main__")
        exec(request.code, vars(main))
    else:
        runpy.run_module(request.module, run_name="__main__", alter_sys=True)


def main() -> None:
    """Import, and serve."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    before, installed = dict(os.environ), sys.path[1:]
    for name in IMPORTED:
        importlib.import_module(name)
    warm_processes.address = sys.argv[1]
    warm_processes.use_server()
    xdist.__doc__ = "PYTEST_DONT_REWRITE"  # else pytest warns that it has been imported already
    gc.freeze()  # a collection would copy the pages that are shared
    go_on(requests(sys.argv[1], before), installed)


if __name__ == "__main__":
    main()
