from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.errors import TimeLimitError
from pytest_libero_max.evaluation.processes.crash_log import read_death

HEAD = """
import itertools
import os
import sys
import time
from pathlib import Path
from pytest_libero_max.errors import LimitReached
from pytest_libero_max.evaluation.processes.crash_log import CrashLog
from pytest_libero_max.evaluation.processes.time_limits import Limits, Watchdog

def worker(limits):
    return Watchdog(limits, CrashLog(Path(sys.argv[1])))
"""


def run_script(tmp_path: Path, body: str) -> tuple[int, Path]:
    log = tmp_path / "crash-log"
    done = subprocess.run([sys.executable, "-c", HEAD + body, str(log)], capture_output=True, timeout=60)
    assert done.returncode <= 0, done.stderr.decode()
    return done.returncode, log


@pytest.mark.parametrize(
    ("limits", "calls", "begins"),
    [
        (
            "step=0.2",
            "dog.query(); dog.step()",
            "a step of the simulator took longer than --libero-max-timeout=step",
        ),
        (
            "query=0.2, step=60",
            "dog.step(); dog.query()",
            "a query of the policy took longer than --libero-max-timeout=query",
        ),
        (
            "query=60, pair=0.2",
            "dog.query()",
            "the pair (last seen in a query of the policy) took longer than ",
        ),
    ],
)
def test_native_code_that_holds_the_interpreter_is_ended(
    tmp_path: Path, limits: str, calls: str, begins: str
) -> None:
    status, log = run_script(
        tmp_path,
        f"""
dog = worker(Limits({limits}))
with dog.pair():
    dog.enter("base")
    {calls}
    any(itertools.repeat(False))
""",
    )
    death = read_death(log, status, "worker gw0")
    assert isinstance(death.error, TimeLimitError)
    assert str(death.error).startswith(begins)
    assert "(<string>, line " in str(death.error)
    assert death.phase == "base"


def test_what_is_in_time_is_left_alone(tmp_path: Path) -> None:
    status, _ = run_script(
        tmp_path,
        """
dog = worker(Limits(query=60, step=60, pair=0.3))
with dog.pair():
    dog.query()
    dog.step()
time.sleep(0.5)  # the pair is over
""",
    )
    assert status == 0


def test_the_session_s_own_process_is_interrupted_before_it_is_ended(
    tmp_path: Path,
) -> None:
    status, _ = run_script(
        tmp_path,
        """
from pytest_libero_max.evaluation.processes import time_limits

time_limits.GRACE_S = 0.2
dog = Watchdog(Limits(query=0.2), None)
for attempt in range(2):
    try:
        with dog.pair():
            dog.query()
            try:
                time.sleep(60)
            except Exception:
                os._exit(1)  # it is none that an adapter handles
    except LimitReached as error:
        assert "line" in str(error)
with dog.pair():
    dog.query()
    any(itertools.repeat(False))
""",
    )
    assert status == -(signal.SIGRTMIN + 10)
