"""The command that a report names plays a case again and gives the same record."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import read_pairs
from tests.plugin.conftest import REACHER, tiny_manifest


def _replayed(pytester: pytest.Pytester, play: Callable[..., pytest.RunResult]) -> tuple[Json, Json]:
    """The first record of the run, and the same from the replay command, which ``play`` runs."""
    folder = Path(pytester.path)
    run = read_pairs(folder / "libero-max-results")
    record = run.records[0]
    command, *arguments = replay_command(run)
    assert command == "pytest"
    result = play("-p", "no:cacheprovider", *arguments, record.item_id)
    assert result.ret == 0
    (again,) = read_pairs(folder / "libero-max-replay").records
    assert (folder / "libero-max-results" / "report.json").exists()
    return record.identity(), again.identity()


def test_the_replay_command_of_a_tiny_run_gives_the_same_record(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(adapter=REACHER)
    manifests = pytester.mkdir("manifests")
    (manifests / "tiny.json").write_text(json.dumps(tiny_manifest()))
    pytester.runpytest_inprocess(
        "-p",
        "no:cacheprovider",
        "--libero-max-policy=adapter.py",
        "--libero-max-manifest=manifests/tiny.json",
        "--libero-max-substrate=tiny",
        "--libero-max-prefix=replay",
        "--libero-max-horizon=9",
        "--libero-max-query-interval=3",
        "--libero-max-noise=floor:1",
        "--libero-max-limit=1",
    )
    before, after = _replayed(pytester, pytester.runpytest_inprocess)
    assert before == after
    assert "base_again" in before["arms"]
    assert (before["policy"]["horizon"], before["policy"]["query_interval"]) == (9, 3)


def test_the_replay_command_of_an_embedded_run_gives_the_same_record(pytester: pytest.Pytester) -> None:
    arguments = ["--libero-max-policy=noop", "--libero-max-track=smoke", "--libero-max-limit=1"]
    # In processes of their own: numba, which compiles the control loop, cannot be imported twice in one.
    pytester.runpytest_subprocess("-p", "no:cacheprovider", *arguments)
    before, after = _replayed(pytester, pytester.runpytest_subprocess)
    assert before == after
