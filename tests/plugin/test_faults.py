"""Faults on purpose: what is lost, what is counted, the exit status and the message."""

from __future__ import annotations

from typing import Any

import pytest

from tests.plugin.test_run import Results, Run

FAULTY = """
import ctypes
import itertools
import multiprocessing
import os
import sys
import time

import numpy as np
from adapter import Reacher


class Faulty(Reacher):
    def predict(self, observation, query):
        name = os.environ["PYTEST_CURRENT_TEST"].split("i00-")[1].split("]")[0]
        fault = {faults}.get(name, "")
        if fault.startswith("once "):
            fault = "" if os.path.exists(name) else fault.removeprefix("once ")
            open(name, "w").close()
        getattr(self, fault or "nothing")()
        return super().predict(observation, query)

    def nothing(self):
        pass

    def leave(self):
        print("I leave", file=sys.stderr)
        os._exit(3)

    def segfault(self):
        os.write(2, b"native words\\n")
        ctypes.string_at(0)

    def sleep(self):
        time.sleep(1000)

    def hang_in_native_code(self):
        any(itertools.repeat(False))  # no signal handler of Python's runs, no other thread

    def fork_and_leave(self):
        helper = multiprocessing.get_context("fork").Process(target=time.sleep, args=(60,))
        helper.start()
        print("I leave", file=sys.stderr)
        os._exit(3)

    def allocate(self):
        np.empty(10**12)


policy = Faulty
"""


@pytest.fixture
def faulty(run: Run, pytester: pytest.Pytester) -> Any:
    """Runs some pairs, of which those named by event and variant have a fault."""

    def go(*args: str, **faults: str) -> pytest.RunResult:
        names = {name.replace("__", "-"): fault for name, fault in faults.items()}
        pytester.makepyfile(faulty=FAULTY.format(faults=names))
        chosen = ("-k", "camera_shift or illumination", "--libero-max-policy=faulty.py")
        return run(*chosen, *args, policy=None, subprocess=True)

    return go


def _errors(results: Results) -> dict[str, tuple[str, str]]:
    """Kind and message of what could not be measured, by event and variant."""
    return {
        line["item_id"].split("i00-")[1]: (line["kind"], line["message"])
        for line in results()[0]
        if line["line"] == "error"
    }


def test_a_pair_that_kills_its_worker_is_played_again_and_then_set_aside(
    faulty: Any, results: Results, pytester: pytest.Pytester
) -> None:
    result = faulty(
        "-n1", "--libero-max-retries=1", camera_shift__v0="segfault", camera_shift__v1="once fork_and_leave"
    )
    ((name, (kind, message)),) = _errors(results).items()
    assert (name, kind) == ("camera_shift-v0", "CrashError")
    assert "signal 11 (SIGSEGV)" in message
    assert "'native words'. Played 2" in message
    assert result.ret == 11
    result.stdout.fnmatch_lines(
        [
            "INCOMPLETE: 3 of 4 planned pairs played, 1 invalid, 0 missing*",
            "Set aside, because each process that played it died: libero-spatial-t00-i00-camera_shift-v0.*",
            "*1 failed, 3 passed, 2 retried*",
        ]
    )
    crashes = sorted((pytester.path / "libero-max-results" / "crashes").iterdir())
    assert [path.name.split("i00-")[1] for path in crashes] == [
        "camera_shift-v0.1.txt",
        "camera_shift-v0.2.txt",
        "camera_shift-v1.1.txt",
    ]
    assert "in segfault" in crashes[0].read_text()
    assert "I leave" in crashes[2].read_text()


def test_pairs_are_handed_out_one_by_one_whatever_a_project_chooses_for_its_tests(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makeini("[pytest]\naddopts = --dist=each")
    pytester.makepyfile(test_mine="def test_mine(): pass")
    done = run("-n2", "libero-max", "test_mine.py", "-k", "camera_shift or mine", subprocess=True)
    done.assert_outcomes(passed=3)
    assert sorted(line["line"] for line in results()[0]) == ["pair", "pair"]
    done.stdout.fnmatch_lines(["*--dist=each is replaced by --dist=worksteal*"])


def test_workers_of_any_kind_play_each_pair_once_and_again_where_one_dies(
    faulty: Any, results: Results
) -> None:
    done = faulty(
        "--tx=2*popen", "--libero-max-order=shuffled:1", "-k", "camera_shift", camera_shift__v0="once leave"
    )
    assert done.ret == 0
    done.stdout.fnmatch_lines(["*2 passed*1 retried*"])
    counts = results()[1]["pairs"]
    assert (counts["planned"], counts["played"]) == (2, 2)


def test_an_isolated_pair_ends_alone(faulty: Any, results: Results) -> None:
    result = faulty(
        "-n0",
        "--libero-max-isolate",
        "--libero-max-retries=0",
        "--libero-max-timeout=query:3",
        "--libero-max-memory=4",
        camera_shift__v0="leave",
        camera_shift__v1="hang_in_native_code",
        illumination_switch__v0="allocate",
    )
    errors = _errors(results)
    assert {name: kind for name, (kind, _) in errors.items()} == {
        "camera_shift-v0": "CrashError",
        "camera_shift-v1": "TimeLimitError",
        "illumination_switch-v0": "MemoryLimitError",
    }
    assert "status 3 in a query" in errors["camera_shift-v0"][1]
    hung = "a query of the policy took longer than --libero-max-timeout=query:3 allows (faulty.py, line "
    assert errors["camera_shift-v1"][1].startswith(hung)
    assert "in hang_in_native_code" in errors["camera_shift-v1"][1]
    assert "more than 4.0 GiB" in errors["illumination_switch-v0"][1]
    assert result.ret == 11
    result.stdout.fnmatch_lines(["INCOMPLETE: 1 of 4 planned pairs played, 3 invalid, 0 missing*"])


def test_the_session_s_own_process_records_a_hung_pair_and_stops(faulty: Any, results: Results) -> None:
    result = faulty("-n0", "--libero-max-timeout=query:3", camera_shift__v1="sleep")
    ((name, (kind, message)),) = _errors(results).items()
    assert (name, kind) == ("camera_shift-v1", "TimeLimitError")
    assert message.startswith(
        "a query of the policy took longer than --libero-max-timeout=query:3 allows (faulty.py, line "
    )
    assert result.ret == 11
    result.stdout.fnmatch_lines(
        [
            "INCOMPLETE: 1 of 4 planned pairs played, 1 invalid, 2 missing*",
            "*Play with -n 1 or --libero-max-isolate*",
        ]
    )


def test_workers_that_only_die_stop_the_run(faulty: Any, results: Results, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(deadly="import os\n\nos._exit(5)\npolicy = None\n")
    result = faulty("-n1", "--libero-max-retries=0", "--libero-max-policy=deadly.py")
    assert {kind for kind, _ in _errors(results).values()} == {"CrashError"}
    assert len(_errors(results)) == 1
    assert result.ret == 11
    result.stdout.fnmatch_lines(["*the policy cannot be played: it ends each process that loads it*"])
