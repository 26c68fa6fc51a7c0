"""Plays a pair in a process of its own, which a crash, a leak or altered global state cannot outlive."""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.evaluation.player import BROKEN_POLICY, Unsupported
from pytest_libero_max.evaluation.processes.crash_log import CrashLog, Death, read_death
from pytest_libero_max.evaluation.processes.deaths import keep_text, pair_error
from pytest_libero_max.evaluation.processes.pair_process import PairProcess
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.machine import end_with_parent
from pytest_libero_max.pairing.record import POLICY_PHASE, PairError, PairRecord
from pytest_libero_max.plugin.run_pair import explain, play
from pytest_libero_max.plugin.run_stop import stop_run
from pytest_libero_max.plugin.stash_keys import NOTE, RESULT


def play_isolated(request: pytest.FixtureRequest, case: Case, settings: Settings) -> PairRecord:
    """Play a pair in a child of this process, and again in another one if it dies.

    The child has the tests, fixtures and options of this process, which itself never loads the policy.
    """
    node = request.node
    with tempfile.TemporaryDirectory(prefix="libero-max-") as folder:
        for number in range(1, settings.retries + 2):
            told = _in_child(Path(folder), lambda log: _played(request, case, settings, log))
            if not isinstance(told, Death):
                break
            keep_text(settings.output, case.item_id, number, told.text)
    if isinstance(told, Death):
        error = pair_error(case, told, number)
        told = {"error": error.to_dict(), "text": f"{error.kind}: {error.message}"}
    if "skip" in told:
        pytest.skip(told["skip"])
    if "record" in told:
        if told["note"] is not None:
            node.stash[NOTE] = told["note"]
        return PairRecord.from_dict(told["record"])
    if "error" in told:
        node.stash[RESULT] = told["error"]
        if told["error"]["phase"] == POLICY_PHASE:
            stop_run(node, BROKEN_POLICY)
    pytest.fail(told["text"], pytrace=False)


def _played(request: pytest.FixtureRequest, case: Case, settings: Settings, log: CrashLog) -> Json:
    """Play the pair in the child; return its result as JSON values."""
    workers = getattr(request.config, "workerinput", {}).get("workercount", 1)
    process = PairProcess(settings, int(workers), log)
    try:
        with process.pair():
            record = play(request, case, settings, process)
    except Unsupported as unsupported:
        return {"skip": str(unsupported)}
    except pytest.skip.Exception as skipped:
        return {"skip": str(skipped)}
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        text = explain(error)
        if type(error).__module__.startswith("_pytest."):
            return {"text": text}
        return {"error": PairError.of(case, error, process.phase).to_dict(), "text": text}
    return {"record": record.to_dict(), "note": request.node.stash.get(NOTE, None)}


def _in_child(folder: Path, play: Callable[[CrashLog], Json]) -> Json | Death:
    """Call a function in a child of this process; return its result, or the death of the child."""
    log, answer = folder / "crash-log", folder / "answer"
    answer.unlink(missing_ok=True)
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        # The threads of this process, such as xdist's receiver, do not go on in the child, which needs none.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _be_child(log, answer, play)
    try:
        _, status = os.waitpid(child, 0)
    finally:  # what the adapter has started, and after an interrupt the child itself
        with suppress(OSError):
            os.killpg(child, signal.SIGKILL)
    try:
        told: Json = json.loads(answer.read_bytes())
    except (OSError, ValueError):
        death = read_death(log, os.waitstatus_to_exitcode(status), "the process of the pair")
        sys.stderr.write(death.text)
        return death
    return told


def _be_child(log: Path, answer: Path, play: Callable[[CrashLog], Json]) -> NoReturn:
    try:
        end_with_parent()
        os.setpgid(0, 0)
        told = play(CrashLog(log))
        part = answer.with_name("part")
        part.write_text(json.dumps(told), encoding="utf-8")
        part.replace(answer)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(0)  # without the handlers of the session's exit, which are not the child's
