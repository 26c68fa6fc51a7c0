from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.errors import CrashError, MemoryLimitError, TimeLimitError
from pytest_libero_max.plugin.processes.crash_log import MEMORY, read_death
from pytest_libero_max.plugin.processes.guard import memory_gib

HEAD = """
import itertools
import os
import sys
import time
from pathlib import Path
from pytest_libero_max.errors import LimitReached
from pytest_libero_max.plugin.processes.crash_log import LastWords
from pytest_libero_max.plugin.processes.timeouts import Limits
from pytest_libero_max.plugin.processes.watchdog import Watchdog

def worker(limits):
    return Watchdog(limits, LastWords(Path(sys.argv[1])))
"""


def _run(tmp_path: Path, body: str) -> tuple[int, Path]:
    words = tmp_path / "words"
    done = subprocess.run([sys.executable, "-c", HEAD + body, str(words)], capture_output=True, timeout=60)
    assert done.returncode <= 0, done.stderr.decode()
    return done.returncode, words


@pytest.mark.parametrize(
    ("limits", "calls", "begins"),
    [
        (
            "step=0.2",
            "dog.query(); dog.step()",
            "a step of the simulator took longer than --libero-max-step-",
        ),
        (
            "query=0.2, step=60",
            "dog.step(); dog.query()",
            "a query of the policy took longer than --libero-max-query-",
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
    status, words = _run(
        tmp_path,
        f"""
dog = worker(Limits({limits}))
with dog.pair():
    dog.enter("base")
    {calls}
    any(itertools.repeat(False))
""",
    )
    death = read_death(words, status, "worker gw0")
    assert isinstance(death.error, TimeLimitError)
    assert str(death.error).startswith(begins)
    assert "(<string>, line " in str(death.error)
    assert death.phase == "base"


def test_what_is_in_time_is_left_alone(tmp_path: Path) -> None:
    status, _ = _run(
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
    status, _ = _run(
        tmp_path,
        """
from pytest_libero_max.plugin.processes import watchdog

watchdog.GRACE_S = 0.2
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


def test_last_words_say_what_a_process_did(tmp_path: Path) -> None:
    status, path = _run(
        tmp_path,
        """
from pytest_libero_max.plugin.processes.crash_log import Doing

words = LastWords(Path(sys.argv[1]))
with words.hearing():
    print("of an earlier pair", file=sys.stderr)
    kept = sys.stderr
print("between two pairs", file=kept)
with words.hearing():
    print("with the stream of an earlier pair", file=kept)
    words.note(Doing("dynamic", "a query of the policy"))
    print("from Python", file=sys.stderr)
    os.write(2, b"from native code")
    os.abort()
""",
    )
    death = read_death(path, status, "worker gw3")
    assert isinstance(death.error, CrashError)
    message = str(death.error)
    assert message.startswith("worker gw3 died of signal 6 (SIGABRT) in a query of the policy (<string>, ")
    assert message.endswith("Its last line on stderr: 'from native code'.")
    assert death.phase == "dynamic"
    assert death.text.startswith("with the stream of an earlier pair\nfrom Python\n")


def test_a_process_without_last_words_died_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "torn").write_bytes(b'{"phase": "ba')
    for path in (None, tmp_path / "missing", tmp_path / "torn"):
        death = read_death(path, None, "worker gw0")
        assert str(death.error) == "worker gw0 died."
        assert death.phase == death.text == ""
    killed = read_death(None, -9, "worker gw0")
    assert "signal 9 (SIGKILL). The kernel sends it to a process when the machine has no memory" in str(
        killed.error
    )


def test_a_kill_during_the_loading_of_the_policy_is_not_the_policy_s(tmp_path: Path) -> None:
    _, path = _run(tmp_path, "worker(Limits()).enter('policy')")
    assert read_death(path, -9, "worker gw0").phase == ""
    assert read_death(path, 1, "worker gw0").phase == "policy"


def test_memory_is_said_by_whoever_had_none(tmp_path: Path) -> None:
    status, path = _run(
        tmp_path,
        f"""
from pytest_libero_max.plugin.processes.crash_log import Doing

LastWords(Path(sys.argv[1])).note(Doing("base", {MEMORY!r}, "too much"))
""",
    )
    death = read_death(path, 70, "worker gw0")
    assert isinstance(death.error, MemoryLimitError)
    assert str(death.error) == "worker gw0: too much"
    assert status == 0


def test_the_memory_of_the_machine_is_shared() -> None:
    whole = memory_gib(None, 1, 4.0)
    assert whole is not None
    assert memory_gib(None, 10_000, 4.0) == 4.0
    assert memory_gib(None, 2, 4.0) == max(4.0, whole / 2)
    assert memory_gib(0.0, 2, 4.0) is None
    assert memory_gib(3.5, 2, 4.0) == 3.5
