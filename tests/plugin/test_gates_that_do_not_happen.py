"""Ways in which a gate that does not hold might not be decided: none of them ends with status 0."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cli import main
from tests.plugin.test_run import Run

GATE = "dynamic_sr >= 0.6"
ONE = ("-k", "camera_shift and v0")
ASKED = (f"--libero-max-gate={GATE}", "--libero-max-retries=0")


@dataclass(frozen=True)
class Way:
    """A way in which a gate was tried to pass by not happening.

    Attributes:
        must: Exit status that it must have.
        conftest: Body of a ``conftest.py``, with ``os``, ``pytest`` and ``Path``.
        policy: What the policy does when it is asked, before it answers.
        ini: Lines of the ini file.
        arguments: Further arguments of pytest.
        variables: Variables of the environment.
        workers: True to let xdist or what is left of it play; otherwise each pair is played in its own
            process.
        subprocess: True for a session that is a process of its own, which starting workers needs.
    """

    must: int
    conftest: str = ""
    policy: str = ""
    ini: str = ""
    arguments: tuple[str, ...] = ASKED
    variables: Mapping[str, str] = field(default_factory=dict)
    workers: bool = False
    subprocess: bool = False


EXIT = "import os; os._exit(0)"
NOT_REPEATABLE = "if not os.path.exists('calm'): answer[:, 6] = next(numbers) / 100"
AGAIN = """
from _pytest.runner import runtestprotocol

@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    for _ in range(30):
        item._initrequest()
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        if not any(report.failed for report in reports):
            break
        Path("calm").touch()
    return True
"""
"""As a plugin for reruns does it."""

WAYS = {
    "report hook": Way(10, "def pytest_libero_max_report(report): raise SystemExit(0)"),
    "reported hook, pytest.exit": Way(10, "def pytest_libero_max_reported(numbers): pytest.exit('', 0)"),
    "reported hook, unprintable": Way(
        10,
        """
class Unprintable(Exception):
    def __str__(self): raise ValueError
def pytest_libero_max_reported(numbers): raise Unprintable
""",
    ),
    "report hook writes better pairs": Way(
        10,
        """
def pytest_libero_max_report(config):
    pairs = Path("libero-max-results", "pairs.jsonl")
    pairs.write_text(pairs.read_text().replace('"success":false', '"success":true'))
""",
    ),
    "stored hook, pytest.exit": Way(10, "def pytest_libero_max_pair_stored(pair): pytest.exit('', 0)"),
    "session start": Way(3, "def pytest_sessionstart(): raise SystemExit(0)"),
    "session end sets 0 last": Way(
        10,
        """
@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session):
    yield
    session.exitstatus = 0
""",
    ),
    "main": Way(
        11,
        """@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(): return 0""",
    ),
    "loop": Way(
        11,
        """@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(): return True""",
    ),
    "report of the test": Way(
        10,
        """
@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport():
    report = yield
    report.outcome, report.libero_max = "passed", None
    return report
""",
    ),
    "skipped items": Way(
        11,
        """
def pytest_collection_modifyitems(items):
    for item in items: item.add_marker(pytest.mark.skip)
""",
    ),
    "other policy": Way(
        11,
        """
@pytest.fixture(scope="session")
def libero_max_policy():
    from adapter import Reacher
    return Reacher()
""",
    ),
    "the budget of the session ends": Way(
        2,
        """
def pytest_libero_max_pair_stored(config):
    config.pluginmanager.get_plugin("session").shouldstop = "enough"
""",
        arguments=(*ASKED, "-k", "camera_shift"),
    ),
    "a rerun until it passes": Way(11, AGAIN, policy=NOT_REPEATABLE),
    "the policy exits": Way(11, policy=EXIT),
    "the policy calls pytest.exit": Way(11, policy="import pytest; pytest.exit('', 0)"),
    "the policy skips": Way(11, policy="import pytest; pytest.skip('too hard')"),
    "the policy kills itself": Way(11, policy="import os, signal; os.kill(os.getpid(), signal.SIGKILL)"),
    "no worker by the environment": Way(
        11,
        policy=EXIT,
        arguments=(*ASKED, "-n", "auto"),
        variables={"PYTEST_XDIST_AUTO_NUM_WORKERS": "0"},
        workers=True,
        subprocess=True,
    ),
    "workers taken back": Way(
        11, policy=EXIT, arguments=(*ASKED, "--tx=popen", "-n0", "--dist=load"), workers=True, subprocess=True
    ),
    "no xdist": Way(11, policy=EXIT, arguments=(*ASKED, "-p", "no:xdist"), workers=True, subprocess=True),
    "a debugger": Way(4, arguments=(*ASKED, "--pdb"), workers=True),
    "a key with dashes": Way(4, ini=f"libero-max-gate = {GATE}", arguments=()),
    "no condition": Way(4, arguments=("--libero-max-gate=",)),
    "holds for these pairs": Way(4, arguments=("--libero-max-gate=regressions <= 1",)),
    "itself": Way(4, arguments=("--libero-max-gate=regressions_vs(libero-max-results) <= 0",)),
    "an unknown setting": Way(4, arguments=("--libero-max-gate=regressions_vs(nowhere, allow=all) <= 0",)),
    "a plugin left out": Way(10, arguments=(*ASKED, "-p", "no:libero-max-controller")),
    "nothing chosen": Way(5, arguments=(*ASKED, "-k", "nothing")),
    "an output that is a file": Way(4, arguments=(*ASKED, "--libero-max-output=tiny.json")),
}
"""Each way by its name."""

LEAVER = """
import itertools
import os

import numpy as np
from adapter import Reacher

numbers = itertools.count()

class policy(Reacher):
    def predict(self, observation, query):
        answer = super().predict(observation, query)
        {}
        return answer
"""


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_no_way_ends_with_status_0(
    run: Run, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, way: Way
) -> None:
    if way.conftest:
        pytester.makeconftest(f"import os\nimport pytest\nfrom pathlib import Path\n{way.conftest}")
    if way.ini:
        pytester.makeini(f"[pytest]\n{way.ini}\n")
    for name, value in way.variables.items():
        monkeypatch.setenv(name, value)
    pytester.makepyfile(leaver=LEAVER.format(way.policy or "pass"))
    chosen = () if "-k" in way.arguments else ONE
    apart = () if way.workers else ("--libero-max-isolate",)
    result = run(*chosen, *apart, *way.arguments, policy="leaver.py", subprocess=way.subprocess)
    assert result.ret == way.must


def test_no_policy(run: Run) -> None:
    assert run(*ASKED, policy=None, subprocess=False).ret == pytest.ExitCode.USAGE_ERROR


def test_a_policy_that_ends_its_process_at_its_end(run: Run, pytester: pytest.Pytester) -> None:
    code = "import atexit, os\natexit.register(os._exit, 0)\n" + LEAVER.format(EXIT)
    pytester.makepyfile(leaver=code)
    result = run(*ONE, *ASKED, policy="leaver.py")
    assert result.ret == 11
    result.stdout.fnmatch_lines(["*CrashError*"])


def test_a_pair_that_was_refused_stays_refused_when_the_run_is_resumed(
    run: Run, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(leaver=LEAVER.format(NOT_REPEATABLE))
    options = ("-k", "camera_shift", "--libero-max-resume", "--libero-max-gate=stale_mean <= 3")
    isolated = (*options, "--libero-max-isolate")
    result = run(*isolated, policy="leaver.py", subprocess=False)
    assert result.ret == 11
    result.stdout.fnmatch_lines(
        ["Refused for what the policy did*", "*2 invalid, 0 missing*begin a new run*"]
    )
    Path("calm").touch()
    result = run(*isolated, policy="leaver.py", subprocess=False)
    assert result.ret == 11
    result.stdout.fnmatch_lines(["*2 refused before, which stay refused*", "*Refused for what the policy*"])
    text = Path("libero-max-results", "pairs.jsonl").read_text()
    lines = [json.loads(line) for line in text.splitlines()]
    assert [(line["line"], line.get("kind")) for line in lines[1:]] == [("error", "RefusalError")] * 2


OTHERWISE = {
    "latency": "--libero-max-latency=2steps",
    "strength": "--libero-max-strength=0.5",
    "query_interval": "--libero-max-query-interval=2",
    "prefix": "--libero-max-prefix=replay",
}
"""Options that make a run another measurement than its baseline, by the difference that a gate names."""


def test_a_run_with_other_settings_than_its_baseline(run: Run) -> None:
    assert run("-k", "camera_shift", "--libero-max-output=before").ret == 0
    gate = "--libero-max-gate=gains_vs(before) >= 1"
    for name, option in OTHERWISE.items():
        result = run("-k", "camera_shift", option, gate, "--libero-max-isolate", subprocess=False)
        assert result.ret == 10
        result.stdout.fnmatch_lines([f"gate open*{name}*allow={name}*"])


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
        result.stdout.fnmatch_lines(
            [f"gate wait*{GATE}*libero-max shards merge decides it, on all 2 shards."]
        )
    return ["1", "2"]


def test_gates_of_shards_are_decided_by_merge(shards: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["shards", "merge", *shards, "--output=whole"]) == 10
    assert f"gate FAIL  {GATE}: failed" in capsys.readouterr().out
    assert main(["shards", "merge", "1", "--output=half"]) == 11
    assert main(["gate", "1", f"--gate={GATE}"]) == 10
    assert main(["gate", "1", "--gate=missing == 0"]) == 10
    assert "libero-max shards merge" in capsys.readouterr().out
    assert main(["shards", "merge", "1", "--output=half", "--gate=missing == 0"]) == 11


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
