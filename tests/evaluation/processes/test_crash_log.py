from __future__ import annotations

from pathlib import Path

from pytest_libero_max.errors import CrashError, MemoryLimitError
from pytest_libero_max.evaluation.processes.crash_log import MEMORY, read_death
from tests.evaluation.processes.test_time_limits import run_script


def test_a_crash_log_says_what_a_process_did(tmp_path: Path) -> None:
    status, path = run_script(
        tmp_path,
        """
from pytest_libero_max.evaluation.processes.crash_log import Activity

log = CrashLog(Path(sys.argv[1]))
with log.capture_stderr():
    print("of an earlier pair", file=sys.stderr)
    kept = sys.stderr
print("between two pairs", file=kept)
with log.capture_stderr():
    print("with the stream of an earlier pair", file=kept)
    log.note(Activity("dynamic", "a query of the policy"))
    print("from Python", file=sys.stderr)
    os.write(2, b"from native code")
    os.abort()
""",
    )
    death = read_death(path, status, "worker gw3")
    assert isinstance(death.error, CrashError)
    message = str(death.error)
    assert message.startswith("worker gw3 died of signal 6 (SIGABRT)")
    assert "(<string>, " in message
    assert "stderr: 'from native code'" in message
    assert death.phase == "dynamic"
    assert death.text.startswith("with the stream of an earlier pair\nfrom Python\n")


def test_a_process_without_a_crash_log_died_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "torn").write_bytes(b'{"phase": "ba')
    for path in (tmp_path / "missing", tmp_path / "torn"):
        death = read_death(path, None, "worker gw0")
        assert str(death.error) == "worker gw0 died."
        assert death.phase == death.text == ""
    killed = read_death(tmp_path / "elsewhere", -9, "worker gw0")
    assert "signal 9 (SIGKILL). The" in str(killed.error)


def test_a_kill_during_the_loading_of_the_policy_is_not_the_policy_s(tmp_path: Path) -> None:
    _, path = run_script(tmp_path, "worker(Limits()).enter('policy')")
    assert read_death(path, -9, "worker gw0").phase == ""
    assert read_death(path, 1, "worker gw0").phase == "policy"


def test_memory_is_said_by_whoever_had_none(tmp_path: Path) -> None:
    status, path = run_script(
        tmp_path,
        f"""
from pytest_libero_max.evaluation.processes.crash_log import Activity

CrashLog(Path(sys.argv[1])).note(Activity("base", {MEMORY!r}, "too much"))
""",
    )
    death = read_death(path, 70, "worker gw0")
    assert isinstance(death.error, MemoryLimitError)
    assert str(death.error) == "worker gw0: too much"
    assert status == 0
