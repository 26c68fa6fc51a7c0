from __future__ import annotations

import subprocess
import sys

import pytest

from tests.plugin.test_run import Results, Run

ADAPTER = """
import atexit, logging, multiprocessing, sys, threading, time
from concurrent.futures import ThreadPoolExecutor
from adapter import Reacher

POOL = ThreadPoolExecutor(1)

class Leaver(Reacher):
    def reset(self, episode):
        HOW

policy = Leaver
"""

CONFTEST = """
import atexit
from pathlib import Path
from pytest_libero_max.plugin.processes import left_running

left_running.PATIENCE_S = 0.3
atexit.register(lambda: Path("at-exit.txt").write_text("as coverage does"))

def pytest_unconfigure():
    Path("unconfigured.txt").touch()
"""

HOW = {
    "thread": "threading.Thread(target=time.sleep, args=(3600,), name='camera').start()",
    "pool": "POOL.submit(time.sleep, 3600)",
    "process": "multiprocessing.get_context('fork').Process(None, time.sleep, 'helper', (3600,)).start()",
}
NAMED = {"thread": "thread 'camera'", "pool": "thread 'ThreadPool", "process": "process 'helper'"}


@pytest.mark.parametrize(("how", "status"), [("thread", 0), ("pool", 0), ("process", 0), ("thread", 11)])
def test_a_session_ends_whatever_its_pairs_leave_running_and_names_it(
    run: Run, results: Results, pytester: pytest.Pytester, how: str, status: int
) -> None:
    fails = "; raise RuntimeError('broken')" if status else ""
    pytester.makepyfile(leaver=ADAPTER.replace("HOW", HOW[how] + fails))
    pytester.makeconftest(CONFTEST)
    done = run(
        "-n0", "-k", "camera_shift and v0", "--junitxml=junit.xml", policy="leaver.py", subprocess=True
    )
    assert done.ret == status
    assert NAMED[how] in done.stderr.str()
    assert len(results()[0]) == 1
    for name in ("at-exit.txt", "unconfigured.txt", "junit.xml"):
        assert (pytester.path / name).exists()


def test_what_ends_by_itself_is_waited_for_and_not_named(run: Run, pytester: pytest.Pytester) -> None:
    brief = "threading.Thread(target=lambda: (time.sleep(0.2), open('ended', 'w'))).start()"
    pytester.makepyfile(leaver=ADAPTER.replace("HOW", brief))
    done = run("-n0", "-k", "camera_shift and v0", policy="leaver.py", subprocess=True)
    assert done.ret == 0
    assert "left running" not in done.stderr.str()
    assert (pytester.path / "ended").exists()


def test_a_program_that_calls_pytest_is_told_and_goes_on(run: Run, pytester: pytest.Pytester) -> None:
    run("--collect-only")  # writes adapter and manifest
    pytester.makepyfile(leaver=ADAPTER.replace("HOW", HOW["thread"]))
    pytester.makeconftest(CONFTEST)
    pytester.makepyfile(
        program="""
        import os, sys, pytest
        status = pytest.main(sys.argv[1:])
        print("goes on", int(status), flush=True)
        os._exit(7)
        """
    )
    arguments = [
        "--libero-max-policy=leaver.py",
        "--libero-max-manifest=tiny.json",
        "--libero-max-substrate=tiny",
    ]
    done = subprocess.run(
        [sys.executable, "program.py", *arguments, "-n0", "-k", "camera_shift and v0"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 7
    assert "goes on 0" in done.stdout
    assert "thread 'camera'" in done.stderr
