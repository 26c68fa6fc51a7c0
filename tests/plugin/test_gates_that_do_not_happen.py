"""Ways in which a gate that does not hold might not be decided: none of them ends with status 0."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cli import main
from tests.plugin.test_run import Run

GATE = "dynamic_sr >= 0.6"
ONE = ("-k", "camera_shift and v0")

LEAVING = {
    "report hook": "def pytest_libero_max_report(report): raise SystemExit(0)",
    "report hook, os._exit": "def pytest_libero_max_report(report): os._exit(0)",
    "report hook, pytest.exit": "def pytest_libero_max_report(report): pytest.exit('', 0)",
    "reported hook": "def pytest_libero_max_reported(numbers): raise SystemExit(0)",
    "reported hook, os._exit": "def pytest_libero_max_reported(numbers): os._exit(0)",
    "reported hook, execvp": "def pytest_libero_max_reported(numbers): os.execvp('true', ['true'])",
    "reported hook, pytest.exit": "def pytest_libero_max_reported(numbers): pytest.exit('', 0)",
    "reported hook, unprintable": """
class Unprintable(Exception):
    def __str__(self): raise ValueError
def pytest_libero_max_reported(numbers): raise Unprintable
""",
    "reported hook removes the pairs": """
def pytest_libero_max_reported(folder): folder.joinpath("pairs.jsonl").unlink()
""",
    "report hook writes better pairs": """
def pytest_libero_max_report(config):
    pairs = Path("libero-max-results", "pairs.jsonl")
    pairs.write_text(pairs.read_text().replace('"success":false', '"success":true'))
""",
    "stored hook": "def pytest_libero_max_pair_stored(pair): raise SystemExit(0)",
    "stored hook, os._exit": "def pytest_libero_max_pair_stored(pair): os._exit(0)",
    "stored hook, pytest.exit": "def pytest_libero_max_pair_stored(pair): pytest.exit('', 0)",
    "session start": "def pytest_sessionstart(): raise SystemExit(0)",
    "session start, pytest.exit": "def pytest_sessionstart(): pytest.exit('', 0)",
    "session end": "def pytest_sessionfinish(session): raise SystemExit(0)",
    "session end sets 0": "def pytest_sessionfinish(session): session.exitstatus = 0",
    "session end sets 0 last": """
@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session):
    yield
    session.exitstatus = 0
""",
    "session end, pytest.exit": "def pytest_sessionfinish(session): pytest.exit('', 0)",
    "summary": "def pytest_terminal_summary(): raise SystemExit(0)",
    "unconfigure": "def pytest_unconfigure(): raise SystemExit(0)",
    "main": "@pytest.hookimpl(tryfirst=True)\ndef pytest_cmdline_main(): return 0",
    "loop": "@pytest.hookimpl(tryfirst=True)\ndef pytest_runtestloop(): return True",
    "protocol": "@pytest.hookimpl(tryfirst=True)\ndef pytest_runtest_protocol(): return True",
    "report of the test": """
@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport():
    report = yield
    report.outcome, report.libero_max = "passed", None
    return report
""",
    "items": "def pytest_collection_modifyitems(items): items.clear()",
    "skipped items": """
def pytest_collection_modifyitems(items):
    for item in items: item.add_marker(pytest.mark.skip)
""",
    "other pair": "@pytest.fixture\ndef libero_max_pair(): pass",
    "other policy": """
@pytest.fixture(scope="session")
def libero_max_policy():
    from adapter import Reacher
    return Reacher()
""",
}
"""Bodies of a ``conftest.py``."""


@pytest.mark.parametrize("conftest", LEAVING.values(), ids=LEAVING)
def test_hooks(run: Run, pytester: pytest.Pytester, conftest: str) -> None:
    pytester.makeconftest(f"import os\nimport pytest\nfrom pathlib import Path\n{conftest}")
    result = run(*ONE, f"--libero-max-gate={GATE}", "--libero-max-isolate", subprocess=False)
    assert result.ret in (3, 5, 10, 11)


POLICIES = {
    "exit": "import os; os._exit(0)",
    "SystemExit": "raise SystemExit(0)",
    "pytest.exit": "import pytest; pytest.exit('', 0)",
    "execv": "import os; os.execv('/bin/true', ['true'])",
    "thread": "import os, threading as t, time; t.Thread(target=os._exit, args=(0,)).start(); time.sleep(9)",
}
"""What a policy does when it is asked."""

LEAVER = """
from adapter import Reacher

class policy(Reacher):
    def predict(self, observation, query):
        {}
"""


@pytest.mark.parametrize("does", POLICIES.values(), ids=POLICIES)
def test_policies_of_isolated_pairs(run: Run, pytester: pytest.Pytester, does: str) -> None:
    pytester.makepyfile(leaver=LEAVER.format(does))
    options = (f"--libero-max-gate={GATE}", "--libero-max-isolate", "--libero-max-retries=0")
    assert run(*ONE, *options, policy="leaver.py", subprocess=False).ret == 11


def test_a_policy_that_ends_its_process(run: Run, pytester: pytest.Pytester) -> None:
    code = "import atexit, os\natexit.register(os._exit, 0)\n" + LEAVER.format(POLICIES["exit"])
    pytester.makepyfile(leaver=code)
    result = run(*ONE, f"--libero-max-gate={GATE}", "--libero-max-retries=0", policy="leaver.py")
    assert result.ret == 11
    result.stdout.fnmatch_lines(["*CrashError*"])
    alone = (*ONE, f"--libero-max-gate={GATE}", "--libero-max-retries=0", "-p", "no:xdist")
    assert run(*alone, policy="leaver.py").ret == 11


def test_a_policy_that_is_too_slow_each_time(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(leaver=LEAVER.format("import time; time.sleep(60)"))
    limits = ("--libero-max-query-timeout=0.1", "--libero-max-retries=0")
    result = run(*limits, f"--libero-max-gate={GATE}", "-n1", policy="leaver.py")
    assert result.ret == 11


INI = {
    "plural": "libero_max_gates = dynamic_sr >= 0.6",
    "dashes": "libero-max-gate = dynamic_sr >= 0.6",
    "capitals": "LIBERO_MAX_GATE = dynamic_sr >= 0.6",
}


@pytest.mark.parametrize("line", INI.values(), ids=INI)
def test_keys_of_the_ini_file(run: Run, pytester: pytest.Pytester, line: str) -> None:
    pytester.makeini(f"[pytest]\n{line}\n")
    result = run(*ONE)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: ini option*unknown*Did you mean 'libero_max_gate'?*"])


ARGUMENTS = {
    "another name": ("-o", "libero_max_gat=dynamic_sr >= 0.6"),
    "no condition": ("--libero-max-gate=",),
    "nothing chosen": ("-k", "nothing", f"--libero-max-gate={GATE}"),
    "all deselected": ("--deselect=libero-max", f"--libero-max-gate={GATE}"),
    "always holds": ("--libero-max-gate=dynamic_sr >= 0",),
    "no such run": ("--libero-max-gate=regressions_vs(nowhere) <= 0",),
    "itself": ("--libero-max-gate=regressions_vs(libero-max-results) <= 0",),
    "a plugin left out": ("-p", "no:libero-max-controller", f"--libero-max-gate={GATE}"),
}


@pytest.mark.parametrize("arguments", ARGUMENTS.values(), ids=ARGUMENTS)
def test_arguments(run: Run, arguments: tuple[str, ...]) -> None:
    only = () if "-k" in arguments else ONE
    assert run(*only, *arguments, "--libero-max-isolate", subprocess=False).ret in (4, 5, 10)


def test_no_policy(run: Run) -> None:
    assert run(f"--libero-max-gate={GATE}", policy=None, subprocess=False).ret == pytest.ExitCode.USAGE_ERROR


def test_a_debugger_in_the_process_that_decides(run: Run) -> None:
    result = run(f"--libero-max-gate={GATE}", "--pdb", subprocess=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: --pdb plays pairs in the process that decides the gates*"])


def test_a_folder_with_the_name_of_the_pairs(run: Run, pytester: pytest.Pytester) -> None:
    pytester.mkdir("libero-max")
    pytester.makeini(f"[pytest]\nlibero_max_policy = adapter.py\nlibero_max_gate = {GATE}\n")
    result = run("libero-max", policy=None)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: libero-max stands for the pairs*write ./libero-max*"])


@pytest.fixture
def shards(run: Run) -> list[str]:
    """Folders of two shards, which are played with a gate."""
    for number in "12":
        options = (f"--libero-max-shard={number}/2", f"--libero-max-output={number}", "--libero-max-isolate")
        result = run("--libero-max-limit=2", *options, f"--libero-max-gate={GATE}", "-q", subprocess=False)
        assert result.ret == 0
        result.stdout.fnmatch_lines([f"gate wait*{GATE}*libero-max merge decides it, on all 2 shards."])
    return ["1", "2"]


def test_gates_of_shards_are_decided_by_merge(shards: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["merge", *shards, "--output=whole"]) == 10
    assert f"gate FAIL  {GATE}: failed" in capsys.readouterr().out
    assert main(["merge", "1", "--output=half"]) == 11
    assert main(["merge", "1", "--output=half", "--gate=missing == 0"]) == 11


def _edited(line: str, **values: Any) -> str:
    run = json.loads(line)
    for name, value in values.items():
        run["provenance"]["selection"][name] = value
    run["planned"] = run["planned"][:1]
    return json.dumps(run)


@pytest.fixture
def stored(run: Run) -> Path:
    """The pairs of a run of two pairs."""
    assert run("-k", "camera_shift").ret == 0
    return Path("libero-max-results", "pairs.jsonl")


@pytest.mark.parametrize(
    "values", [{}, {"chosen": 1}, {"chosen": 1, "of": 1}], ids=["none", "chosen", "both"]
)
def test_a_header_that_plans_fewer(stored: Path, values: dict[str, int]) -> None:
    first, *rest = stored.read_text().splitlines()
    pair = json.loads(first)["planned"][0]["case_id"]
    rest = [line for line in rest if json.loads(line)["case_id"] == pair]
    stored.write_text("\n".join([_edited(first, **values), *rest, ""]))
    assert main(["gate", "libero-max-results", "--gate=missing == 0", "--gate=whole_track == 1"]) == 1


def test_a_run_that_lacks_a_pair(stored: Path) -> None:
    stored.write_text("".join(stored.read_text().splitlines(keepends=True)[:2]))
    assert main(["gate", "libero-max-results", "--gate=regressions <= 1"]) == 11


@pytest.mark.parametrize("way", [os.link, os.symlink], ids=["hard link", "symbolic link"])
def test_a_baseline_that_is_the_run_itself(stored: Path, way: Any) -> None:
    Path("before").mkdir()
    way(stored.absolute(), Path("before", "pairs.jsonl"))
    assert main(["gate", "libero-max-results", "--gate=regressions_vs(before) <= 0"]) == 1


def test_pairs_that_are_no_file(stored: Path) -> None:
    stored.unlink()
    stored.symlink_to("/dev/zero")
    assert main(["gate", "libero-max-results", "--gate=missing == 0"]) == 1
