"""Worker processes of a run without a pytest session: spawned, each with its own policy and worlds."""

from __future__ import annotations

import json
import multiprocessing
import os
import pickle
import signal
import sys
import tempfile
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import CrashError, OptionError
from pytest_libero_max.evaluation.keeper import RunKeeper
from pytest_libero_max.evaluation.player import BROKEN_POLICY, FailedPair, PairPlayer, Unsupported
from pytest_libero_max.evaluation.policy_source import GivenPolicy, PolicySource
from pytest_libero_max.evaluation.processes.crash_log import CrashLog, read_death
from pytest_libero_max.evaluation.processes.deaths import Deaths
from pytest_libero_max.evaluation.processes.pair_process import PairProcess, Playing, close_in_children
from pytest_libero_max.evaluation.run_cases import RunCases
from pytest_libero_max.evaluation.work_queue import WorkQueue
from pytest_libero_max.machine import end_with_parent
from pytest_libero_max.pairing.record import POLICY_PHASE, PairError, result_from_dict

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import Policy
    from pytest_libero_max.substrates.contract import Substrate
    from pytest_libero_max.worlds.contract import World

_PATIENCE_S = 8.0


@dataclass(frozen=True)
class Job:
    """What a process needs to play pairs of a run."""

    source: PolicySource
    begun_s: float
    """When the run began, seconds since the epoch."""
    workers: int = 1

    def require_sendable(self) -> None:
        """Check that other processes can load the policy, or raise OptionError."""
        source = self.source
        if not isinstance(source, GivenPolicy):
            return
        if not source.is_made:
            raise OptionError(
                f"workers={self.workers} with a policy object, which cannot be sent to other processes. "
                "Give a class or function that makes it, its file or module, or the address of a server; or "
                "play with workers=1."
            )
        main = sys.modules["__main__"]
        if getattr(source.thing, "__module__", "") == "__main__" and not hasattr(main, "__file__"):
            raise OptionError(
                f"workers={self.workers} with {source.settings.policy!r}, which is defined in a notebook or "
                "at a prompt, where other processes cannot import it. Write it into a file and give its "
                "path, or play with workers=1."
            )
        try:
            pickle.dumps(source.thing)
        except Exception as error:
            raise OptionError(
                f"workers={self.workers} with {source.settings.policy!r}, which cannot be sent to other "
                f"processes ({error}). Define it at the top of a module, or play with workers=1."
            ) from error


class OwnSources:
    """Policy and worlds of a process that plays pairs by itself; opened when the first pair needs them."""

    def __init__(self, source: PolicySource, begun_s: float, seat: int) -> None:
        self._source, self._begun_s, self._seat = source, begun_s, seat

    def policy(self) -> Policy:
        return self._policy

    def substrate(self) -> Substrate:
        return self._substrate

    def world(self, case: Case) -> World:
        return self._substrate.world(case)

    @cached_property
    def _policy(self) -> Policy:
        return self._source.load(self._seat, self._begun_s)

    @cached_property
    def _substrate(self) -> Substrate:
        from pytest_libero_max.substrates.registry import open_substrate

        settings = self._source.settings
        return open_substrate(settings.substrate.name, settings.substrate_options)

    def close(self) -> None:
        """Close what was opened."""
        try:
            if "_policy" in vars(self):
                self._source.release(self._policy)
        finally:
            if "_substrate" in vars(self):
                self._substrate.close()


class CasePlayer:
    """Plays pairs with sources of its own, and returns what became of each as JSON values."""

    def __init__(self, job: Job, second: Iterable[str], process: Playing, seat: int = 0) -> None:
        source = job.source
        self._sources, self._process = OwnSources(source, job.begun_s, seat), process
        self._player = PairPlayer(source, frozenset(second))

    def play(self, case: Case) -> Json:
        """Return ``record`` and ``note``, ``error`` and ``stop``, or ``skip``."""
        try:
            with self._process.pair():
                played = self._player.play(case, self._sources, self._process)
        except Unsupported as unsupported:
            return {"skip": str(unsupported)}
        except BaseException as error:
            failed = FailedPair.of(case, self._process, error)
            broken = failed.error.phase == POLICY_PHASE
            return {"error": failed.error.to_dict(), "stop": BROKEN_POLICY if broken else None}
        return {"record": played.record.to_dict(), "note": played.note}

    def close(self) -> None:
        """Close policies and worlds."""
        self._player.close()
        self._sources.close()


@dataclass(eq=False)
class _Worker:
    """A worker, seen from the process that owns the run."""

    number: int
    process: SpawnProcess
    connection: Connection
    log: Path
    pair: Case | None = None
    """The case that it plays; None while it starts and while it is idle."""
    ready: bool = False


class Workers:
    """The workers of a run."""

    def __init__(
        self,
        job: Job,
        keeper: RunKeeper,
        receive: Callable[[str, Json], None],
        began: Callable[[str], None],
    ) -> None:
        self._job, self._keeper, self._receive, self._began = job, keeper, receive, began
        settings = keeper.settings
        self.deaths = Deaths(settings, job.workers, "workers", keeper.stop)
        self._queue = WorkQueue((), steal=not settings.in_order)
        self._workers: list[_Worker] = []
        self._started = 0

    def play(self, names: Iterable[str]) -> None:
        """Play pairs, by item id, until all have a result or the run is stopped.

        Raises:
            CrashError: No worker can be started.
        """
        self._queue = WorkQueue(names, steal=not self._keeper.settings.in_order)
        with tempfile.TemporaryDirectory(prefix="libero-max-") as folder:
            try:
                while self._assign(Path(folder)):
                    for worker in self._answered():
                        self._take(worker)
                self._finish()
            finally:
                for worker in self._workers:
                    _kill(worker)
                self._workers.clear()

    def _assign(self, folder: Path) -> bool:
        """Give pairs to idle workers, and start more; return True while a pair is played or waits."""
        busy = sum(worker.pair is not None for worker in self._workers)
        if self._keeper.stop.stopped is not None:
            return busy > 0
        for worker in self._workers:
            if worker.ready and worker.pair is None and (name := self._queue.take(worker.number)) is not None:
                worker.pair = self._keeper.cases[name]
                self._began(name)
                with suppress(OSError):  # it has died, which is seen next
                    worker.connection.send_bytes(name.encode())
        busy = sum(worker.pair is not None for worker in self._workers)
        wanted = min(self._job.workers, busy + len(self._queue))
        for _ in range(wanted - len(self._workers)):
            self._workers.append(self._start(folder))
        return busy > 0 or len(self._queue) > 0

    def _start(self, folder: Path) -> _Worker:
        taken = {worker.number for worker in self._workers}
        number = next(number for number in range(len(taken) + 1) if number not in taken)
        self._started += 1
        log = folder / f"worker-{self._started}"
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(
            target=_be_worker, args=(self._job, number, theirs, log), name=f"libero-max-{number}"
        )
        process.start()
        theirs.close()
        return _Worker(number, process, ours, log)

    def _answered(self) -> list[_Worker]:
        """Return the workers that have answered or died, once there is one."""
        watched: dict[Any, _Worker] = {}
        for worker in self._workers:
            watched[worker.connection] = watched[worker.process.sentinel] = worker
        return list(dict.fromkeys(watched[end] for end in wait(list(watched))))

    def _take(self, worker: _Worker) -> None:
        try:
            # A helper of the adapter may hold the connection of a dead worker open: do not wait for its end.
            answer = worker.connection.recv_bytes() if worker.connection.poll() else None
        except (EOFError, OSError):
            answer = None
        if answer is None:
            self._lost(worker)
        elif worker.pair is None:
            worker.ready = True
        else:
            case, worker.pair = worker.pair, None
            self._receive(case.item_id, json.loads(answer))

    def _lost(self, worker: _Worker) -> None:
        worker.process.join()
        death = read_death(worker.log, worker.process.exitcode, f"worker {worker.number}")
        self._workers.remove(worker)
        _kill(worker)
        if not worker.ready:
            raise CrashError(
                f"{death.error} It could not begin. A program that plays with workers must be importable: "
                'where it is a script, keep what it does under `if __name__ == "__main__":`.'
            )
        self._queue.leave(worker.number)
        self.deaths.died(death)
        if worker.pair is None:
            return
        name = worker.pair.item_id

        def play_again() -> bool:
            self._queue.give_back(name)
            return True

        lost = self.deaths.lose(worker.pair, death, play_again)
        if isinstance(lost, PairError):
            self._receive(name, {"error": lost.to_dict(), "stop": None})

    def _finish(self) -> None:
        """Let all workers close their policies and end."""
        for worker in self._workers:
            with suppress(OSError):
                worker.connection.send_bytes(b"")
        for worker in self._workers:
            worker.process.join(_PATIENCE_S)


def _kill(worker: _Worker) -> None:
    """End a worker, and what its policy has started in it."""
    if worker.process.pid is not None and worker.ready:
        with suppress(OSError):
            os.killpg(worker.process.pid, signal.SIGKILL)
    worker.process.kill()
    worker.process.join()
    worker.process.close()
    worker.connection.close()


def _be_worker(job: Job, number: int, connection: Connection, log: Path) -> None:
    """Play the pairs whose names arrive, until an empty one does."""
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    end_with_parent()
    # Ctrl-C is for the process that owns the run, and what is started here ends with this one.
    os.setpgid(0, 0)
    close_in_children([connection.fileno()])
    use_one_blas_thread()
    settings = job.source.settings
    cases = RunCases(settings)
    by_name = {case.item_id: case for case in cases.chosen}
    process = PairProcess(settings, job.workers, CrashLog(log))
    seat = number + (0 if settings.shard is None else settings.shard[0] - 1)
    with closing(CasePlayer(job, cases.with_second_base, process, seat)) as player:
        connection.send_bytes(b"ready")
        while name := connection.recv_bytes():
            connection.send_bytes(json.dumps(player.play(by_name[name.decode()])).encode())


def for_workers(source: PolicySource) -> PolicySource:
    """Return a source without what workers do not need, and what may not be sent to them."""
    settings = replace(source.settings, gate=(), stop=None, resume=False)
    if isinstance(source, GivenPolicy):
        return GivenPolicy(settings, source.thing)
    return PolicySource(settings)


def result_in(answer: Json) -> Any:
    """Return the record or error in an answer; None where the pair is not supported; raises ReportError."""
    values = answer.get("record") or answer.get("error")
    return None if values is None else result_from_dict(values)
