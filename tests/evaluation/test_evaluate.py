"""Runs from Python: the same records and numbers as a session's, and nothing left behind."""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import pytest_libero_max
from pytest_libero_max import Episode, Evaluation, PolicySpec, Query, evaluate, read_pairs
from pytest_libero_max.errors import OptionError
from pytest_libero_max.evaluation.keeper import RunKeeper
from pytest_libero_max.policies import loading
from pytest_libero_max.runs.lock import MARK_NAME
from pytest_libero_max.runs.store import PairStore, StoredRun
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.threads import loaded_blas
from tests.plugin.conftest import BUDGET, REACHER, tiny_manifest

SPEC = PolicySpec(name="reacher", horizon=8, query_interval=4, cameras=(), image_size=64)
HOW: dict[str, Any] = {"manifest": "tiny.json", "substrate": "tiny"}


class Reacher:
    """The policy of the sessions, as an object."""

    spec = SPEC

    def __init__(self) -> None:
        self.episodes, self.closed = 0, False

    def reset(self, episode: Episode) -> None:
        self.episodes += 1

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        action = np.zeros(7)
        action[:3] = np.clip((np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]) / 0.05, -1, 1)
        return np.tile(action, (8, 1))

    def close(self) -> None:
        self.closed = True


@pytest.fixture(autouse=True)
def folder(pytester: pytest.Pytester, short_sessions: None) -> Path:
    """The working folder, with an adapter and a manifest; episodes here are short."""
    pytester.makepyfile(adapter=REACHER)
    pytester.path.joinpath("tiny.json").write_text(json.dumps(tiny_manifest()))
    return pytester.path


def played(result: StoredRun) -> dict[str, Any]:
    """The records by case, without timings."""
    return {record.case_id: {**record.to_dict(), "timings": {}} for record in result.records}


def numbers(result: dict[str, Any]) -> dict[str, Any]:
    """A report without what differs between any two runs."""
    volatile = ("started", "command")
    provenance = {name: value for name, value in result["provenance"].items() if name not in volatile}
    return {**result, "provenance": provenance, "timing": None, "unsupported": None}


def test_a_run_from_python_is_that_of_a_session(
    run: Callable[..., pytest.RunResult], folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run("--libero-max-limit=4", "--libero-max-noise=floor:2", "--libero-max-strength=1.0").assert_outcomes(
        passed=4
    )
    capfd.readouterr()
    result = evaluate("adapter.py", limit=4, noise="floor:2", folder="python", gates=["missing == 0"], **HOW)
    assert capfd.readouterr() == ("", "")
    session = read_pairs(folder / "libero-max-results")
    assert played(read_pairs(folder / "python")) == played(session)
    texts = [(folder / name / "report.json").read_text() for name in ("libero-max-results", "python")]
    of_session, of_python = map(numbers, map(json.loads, texts))
    assert of_python == of_session
    assert (result.status, result.passed, result.reason) == (0, True, "")
    assert [gate.verdict for gate in result.gates] == ["passed"]
    assert result.report.pairs.played == result.numbers["pairs/played"] == 4
    assert str(result) == result.summary
    assert (folder / "python" / "report.html").as_uri() in result._repr_html_()
    assert not (folder / "python" / MARK_NAME).exists()


def test_a_gate_that_does_not_hold_is_in_the_result(folder: Path) -> None:
    result = evaluate("adapter.py", limit=1, gates=("dynamic_sr >= 0.5", "missing == 0"), **HOW)
    assert [gate.verdict for gate in result.gates] == ["failed", "passed"]
    assert (result.passed, result.status) == (False, 10)
    assert "gate" in result.reason


def test_a_policy_object_is_played_as_it_is_and_stays_open(folder: Path) -> None:
    policy = Reacher()
    result = evaluate(policy, limit=1, query_interval=2, **HOW)
    assert result.passed
    (record,) = read_pairs(folder / "libero-max-results").records
    assert (record.policy["query_interval"], record.fingerprints["adapter"]) == (2, "object")
    assert policy.spec is SPEC
    assert not policy.closed
    assert policy.episodes


def test_a_factory_is_made_once_and_closed(folder: Path) -> None:
    made: list[Reacher] = []

    def make() -> Reacher:
        made.append(Reacher())
        return made[-1]

    assert evaluate(make, limit=2, **HOW).passed
    assert [policy.closed for policy in made] == [True]


def test_policies_of_arms_are_closed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Reacher] = []

    def installed(name: str) -> Reacher:
        made.append(Reacher())
        return made[-1]

    monkeypatch.setattr(loading, "installed_policy", installed)
    schedule = [{"trigger": "event", "change": "event"}]
    arm = {"name": "dynamic_other", "policy": "noop", "schedule": schedule}
    (folder / "other.json").write_text(json.dumps({"name": "other", "title": "Another", "arms": [arm]}))
    run = evaluate(Reacher(), **HOW, limit=2, study="other.json")
    assert [set(record.arms) for record in read_pairs(run.folder).records] == [
        {"base", "dynamic", "dynamic_other"}
    ] * 2
    assert [policy.closed for policy in made] == [True]


def test_a_class_of_a_module_is_known_by_its_code(folder: Path) -> None:
    assert evaluate(Reacher, limit=1, **HOW).passed
    provenance = read_pairs(folder / "libero-max-results").run.provenance
    assert provenance["policy"]["reference"] == f"{__name__}:Reacher"
    assert len(provenance["policy"]["code"]) == 64


def test_it_plays_within_a_running_loop(folder: Path) -> None:
    async def train() -> Evaluation:
        await asyncio.sleep(0)
        return evaluate(Reacher(), limit=1, **HOW)

    assert asyncio.run(train()).passed


def test_many_runs_in_one_process_leave_nothing_behind(folder: Path) -> None:
    def state() -> tuple[Any, ...]:
        signals = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
        return (
            os.getcwd(),
            list(sys.path),
            dict(os.environ),
            signals,
            loaded_blas(),
            logging.root.handlers[:],
        )

    def kept() -> int:
        gc.collect()
        return sum(isinstance(each, RunKeeper | PairStore | TinyWorld) for each in gc.get_objects())

    evaluate("adapter.py", limit=1, **HOW)
    before, kept_before = state(), kept()
    modules = set(sys.modules)
    for _ in range(2):
        evaluate("adapter.py", limit=1, **HOW)
        evaluate(Reacher(), limit=1, **HOW)
    assert state() == before
    assert set(sys.modules) == modules
    assert len([*folder.glob("libero-max-results/pairs*.jsonl")]) == 5
    assert kept() == kept_before


def test_an_interrupted_run_goes_on(folder: Path) -> None:
    class Impatient(Reacher):
        def reset(self, episode: Episode) -> None:
            super().reset(episode)
            stored = (folder / "libero-max-results" / "pairs.jsonl").read_text().splitlines()[1:]
            if len(stored) == 2 and not self.closed:
                self.closed = True
                raise KeyboardInterrupt

    policy = Impatient()
    with pytest.raises(KeyboardInterrupt):
        evaluate(policy, limit=4, **HOW)
    before = read_pairs(folder / "libero-max-results").records
    assert len(before) == 2
    own, policy.spec = policy.spec, replace(policy.spec, query_interval=1)
    with pytest.raises(OptionError, match=r"policy\.query_interval: .* 1\. Resume with"):
        evaluate(policy, limit=4, resume=True, **HOW)
    policy.spec = own
    result = evaluate(policy, limit=4, resume=True, **HOW)
    assert result.passed
    assert read_pairs(folder / "libero-max-results").records[:2] == before
    assert result.report.pairs.played == 4


def test_an_error_of_the_policy_is_one_of_its_pair(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    class Broken(Reacher):
        def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
            if self.episodes == 1:
                raise RuntimeError("no weights")
            return super().predict(observation, query)

    result = evaluate(Broken(), limit=2, **HOW)
    assert (result.status, result.report.pairs.invalid) == (11, 1)
    assert "no weights" in caplog.text


SCRIPT = """
import json, os
import short_episodes
from pytest_libero_max import evaluate, read_pairs
from adapter import Reacher

class Dying(Reacher):
    spec = Reacher.spec

    def reset(self, episode):
        assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
        if os.path.exists("die"):
            os._exit(3)

if __name__ == "__main__":
    how = {"manifest": "tiny.json", "substrate": "tiny", "workers": 2}
    assert evaluate(Dying, folder="out", limit=4, **how).passed
    open("die", "w").close()
    result = evaluate(Dying, folder="died", retries=0, limit=1, **how)
    print(json.dumps([result.status, [pair.kind for pair in result.report.pairs.invalid_pairs]]))
"""


def test_a_script_plays_in_workers_and_one_that_dies_is_an_error_of_its_pair(folder: Path) -> None:
    (folder / "script.py").write_text(SCRIPT)
    done = subprocess.run([sys.executable, "script.py"], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [11, ["CrashError"]]
    evaluate("adapter.py", limit=4, folder="here", **HOW)
    here = played(read_pairs(folder / "here"))
    as_sent = played(read_pairs(folder / "out"))
    assert {name: record["arms"] for name, record in as_sent.items()} == {
        name: record["arms"] for name, record in here.items()
    }


def test_a_script_without_a_guard_is_told_so(folder: Path) -> None:
    (folder / "script.py").write_text(
        "from pytest_libero_max import evaluate\n"
        'evaluate("adapter.py", manifest="tiny.json", substrate="tiny", limit=1, workers=2)\n'
    )
    done = subprocess.run([sys.executable, "script.py"], capture_output=True, text=True, timeout=600)
    assert done.returncode == 1
    assert "__main__" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"workers": 2}, "workers=2 with a policy object"),
        ({"timeout": "query:5"}, "with a policy object"),
        ({"workers": 0}, "workers=0"),
        ({"limit": 0}, "limit='0'"),
        ({"limitt": 1}, "Did you mean 'limit'"),
        ({"progress": "none"}, "no argument 'progress'"),
        ({"horizon": 2, "query_interval": 4}, "query_interval=4 > horizon=2"),
        ({"gates": ["dynamic_sr ="]}, "gates="),
        ({"track": "smoke"}, "track and manifest"),
    ],
)
def test_arguments_that_cannot_be_used_are_named(
    folder: Path, arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(OptionError) as raised:
        evaluate(Reacher(), **HOW, **arguments)
    assert message in str(raised.value)
    assert "--libero-max" not in str(raised.value)
    assert not (folder / "libero-max-results").exists()


def test_what_workers_cannot_load_is_refused(folder: Path) -> None:
    with pytest.raises(OptionError, match="cannot be sent"):
        evaluate(lambda: Reacher(), workers=2, **HOW)


def test_episodes_here_are_short(folder: Path) -> None:
    assert evaluate(Reacher(), limit=1, **HOW).passed
    (record,) = read_pairs(folder / "libero-max-results").records
    assert record.max_steps == BUDGET


def test_the_facade_offers_it_without_a_simulator() -> None:
    code = "import sys, pytest_libero_max as p; p.evaluate; print(sorted({'mujoco', 'cv2'} & {*sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert {"evaluate", "Evaluation"} <= {*pytest_libero_max.__all__}
