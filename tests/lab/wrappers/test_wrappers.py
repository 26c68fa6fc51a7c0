"""Wrappers around any policy: from the option to the record, and back to a command."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import read_pairs
from tests.plugin.conftest import REACHER, results, run, short_sessions, tiny_manifest

__all__ = ["results", "run", "short_sessions"]  # fixtures

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

SEES = REACHER.replace("cameras=()", 'cameras=("agentview", "robot0_eye_in_hand")')


@pytest.fixture
def noise(pytester: pytest.Pytester, run: Run) -> Run:
    """Plays the two variants of sensor noise with a policy that asks for both images."""
    pytester.makepyfile(sees=SEES)
    pytester.path.joinpath("tiny.json").write_text(json.dumps(tiny_manifest(events=("sensor_noise_onset",))))
    return lambda *args: run(*args, policy="sees.py")


def test_the_mode_is_in_title_record_and_replay_command(
    pytester: pytest.Pytester, noise: Run, results: Results
) -> None:
    assert noise("--libero-max-wrap=restore:gated").ret == 0
    records, report = results()
    for record in records:
        base, dynamic = (record["arms"][name]["notes"] for name in ("base", "dynamic"))
        assert record["policy"]["wrappers"] == ["restore=gated"]
        assert base["queries"] == record["arms"]["base"]["queries"]
        assert base["active"] == 0
        assert dynamic["active"] == dynamic["queries"] > 0
    assert report["policy"]["wrappers"] == ["restore=gated"]
    folder = Path(pytester.path, "libero-max-results")
    assert "restore=gated" in (folder / "report.md").read_text().splitlines()[0]
    assert "--libero-max-wrap=restore:gated" in replay_command(read_pairs(folder))


def test_a_run_is_not_continued_in_another_mode(noise: Run) -> None:
    assert noise("--libero-max-limit=1").ret == 0
    result = noise("--libero-max-limit=1", "--libero-max-resume", "--libero-max-wrap=restore:always")
    assert result.ret != 0
    result.stdout.fnmatch_lines(["*policy.restore: None, 'always'. Resume with the same*"])


def test_a_policy_without_images_stops_the_run(run: Run) -> None:
    result = run("--libero-max-wrap=restore:gated")
    result.stdout.fnmatch_lines(["*asks for no images*Leave restore out of --libero-max-wrap.*"])
    assert result.ret != 0


def test_an_adaptive_run_has_its_words_in_title_record_and_replay_command(
    pytester: pytest.Pytester, noise: Run, results: Results
) -> None:
    options = ("--libero-max-wrap=adaptive:image", "--libero-max-query-interval=2", "--libero-max-limit=1")
    assert noise(*options).ret == 0
    (record,), report = results()
    notes = record["arms"]["base"]["notes"]
    assert report["policy"]["wrappers"] == ["adaptive=image H=8 Q=2"]
    assert notes["looks"] == record["arms"]["base"]["queries"] == record["arms"]["base"]["steps"]
    assert notes["asked"] < notes["looks"]
    command = replay_command(read_pairs(Path(pytester.path, "libero-max-results")))
    assert {"--libero-max-wrap=adaptive:image", "--libero-max-query-interval=2"} <= set(command)


def test_a_sweep_of_fixed_intervals_is_not_adaptive(run: Run) -> None:
    result = run("--libero-max-study=cadence:2", "--libero-max-wrap=adaptive:image")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*chooses when to ask*Leave one of them out.*"])


def test_an_unknown_mode_is_refused(run: Run) -> None:
    result = run("--libero-max-wrap=restore:sometimes")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(
        ["*--libero-max-wrap='restore:sometimes': 'restore:sometimes': unknown value. Known: always, gated.*"]
    )
