"""Actor that Ray places on a node: starts a process that plays pairs, and reads its crash log if it dies."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.evaluation.processes.crash_log import read_death
from pytest_libero_max.plugin.processes.this_process import CRASH_LOG_INPUT

_ROUNDING = 1e-9
"""0.3 / 0.1 is a little less than 3."""

_POLL_S = 0.5
_KEPT_CHUNKS = 16
_PATIENCE_S = 8.0
"""Time for the process to end its session in order, s."""


class PairActor:
    """Plays pairs in a process of its own, whose crash the actor survives.

    Its methods take and return text: JSON that no process has to trust.

    Args:
        plan: Arguments, environment, folder and worker's input of the pytest session that plays, and the
            resources of this actor.
    """

    def __init__(self, plan: str) -> None:
        self._plan: Json = json.loads(plan)
        self._folder = tempfile.TemporaryDirectory(prefix="libero-max-")
        self._crash_log = Path(self._folder.name, "crash-log")
        self._process: subprocess.Popen[bytes] | None = None
        self._said: deque[bytes] = deque(maxlen=_KEPT_CHUNKS)
        self._unread = b""

    def start(self) -> str:
        """Start the process. Returns the identity of what it collected, its death, or why it cannot play."""
        plan = self._plan
        folder = plan["folder"] or os.getcwd()
        where = self._where()
        if not Path(folder).is_dir():
            return json.dumps({"refused": f"{where} has no folder {folder!r}.", "where": where})
        # The folder is on the path of modules where it is on that of the controller.
        path = [] if plan["folder_on_path"] else ["-P"]
        self._process = subprocess.Popen(
            [sys.executable, *path, "-m", f"{__package__}.remote", *plan["arguments"]],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=folder,
            env={**os.environ, **plan["environment"]},
            start_new_session=True,
        )
        threading.Thread(target=self._listen, args=(self._process.stderr,), daemon=True).start()
        shared = {CRASH_LOG_INPUT: str(self._crash_log), "workercount": self._neighbours()}
        self._send({**plan["workerinput"], **shared})
        answer = self._answer()
        if "died" in answer and (self._process.returncode or 0) >= 0:
            said = b"".join(self._said).decode(errors="replace").strip()
            answer = {"refused": f"The session on {where} ended before it could play: {said[-2000:]}"}
        return json.dumps({**answer, "where": where})

    def play(self, name: str) -> str:
        """Play a pair. Returns its reports, or the death of the process."""
        self._send({"play": name})
        return json.dumps(self._answer())

    def finish(self) -> None:
        if self._process is not None:
            assert self._process.stdin is not None
            with suppress(OSError):
                self._process.stdin.close()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_PATIENCE_S)
            self._end_all(self._process)

    def _send(self, command: Json) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(OSError):  # it has died, which the answer says
            self._process.stdin.write(json.dumps(command).encode() + b"\n")
            self._process.stdin.flush()

    def _answer(self) -> Json:
        line = self._line()
        if line is not None:
            answer: Json = json.loads(line)
            return answer
        assert self._process is not None
        self._end_all(self._process)
        return {
            "died": read_death(
                self._crash_log, self._process.wait(), f"the process on {self._where()}"
            ).to_dict()
        }

    def _line(self) -> bytes | None:
        """Return the next line that the process writes; None when it has died.

        Its end is not waited for by the pipe alone, which a helper of the adapter may hold open.
        """
        assert self._process is not None
        assert self._process.stdout is not None
        pipe = self._process.stdout.fileno()
        while b"\n" not in self._unread:
            ended = self._process.poll() is not None
            if select.select([pipe], [], [], 0 if ended else _POLL_S)[0]:
                chunk = os.read(pipe, 2**20)
                if not chunk:
                    return None
                self._unread += chunk
            elif ended:
                return None
        line, _, self._unread = self._unread.partition(b"\n")
        return line

    def _listen(self, stderr: Any) -> None:
        """Pass on the stderr of the process, and keep the end of it."""
        while chunk := os.read(stderr.fileno(), 4096):
            self._said.append(chunk)
            with suppress(OSError):
                os.write(2, chunk)

    def _end_all(self, process: subprocess.Popen[bytes]) -> None:
        """Kill the process, and those that the adapter has started in it."""
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)

    def _where(self) -> str:
        import ray

        return f"node {ray.util.get_node_ip_address()}"

    def _neighbours(self) -> int:
        """Return the number of actors like this one that may share the memory of the node."""
        import ray

        here = ray.get_runtime_context().get_node_id()
        nodes = [node["Resources"] for node in ray.nodes() if node["NodeID"] == here]
        return (
            max([actors_on(node, self._plan["cpus"], self._plan["gpus"]) for node in nodes], default=0) or 1
        )


def actors_on(resources: Mapping[str, float], cpus: float, gpus: float) -> int:
    """Return the number of actors that one node with these resources has room for."""
    limits = []
    if cpus:
        limits.append(int(resources.get("CPU", 0) / cpus + _ROUNDING))
    if gpus:
        there = resources.get("GPU", 0)
        on_each = int(1 / gpus + _ROUNDING)
        limits.append(int(there) * on_each if gpus < 1 else int(there / gpus + _ROUNDING))
    return min(limits, default=0)
