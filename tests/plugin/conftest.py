from __future__ import annotations

import json
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, resolve_event
from pytest_libero_max.pairing import runner, trace
from pytest_libero_max.report.writers import report_files
from pytest_libero_max.substrates import tiny
from pytest_libero_max.tasks.contents import InitialPlacement, Relation, TaskMetadata
from tests.short_episodes import short_episodes, shorten_here

# An in-process run forgets what it imported, and NumPy cannot be imported twice: import it all here first.
IMPORTED_ONCE = (report_files, runner, tiny, trace)

ON_TABLE = InitialPlacement("On", "main_table_region", "main_table")
CLUTTER = {f"clutter_{number}": "clutter" for number in range(1, 6)}

TINY_TASK = TaskMetadata(
    name="put_the_box_on_the_plate",
    language="put the box on the plate",
    objects={"box_1": "box", "plate_1": "plate", **CLUTTER},
    fixtures={"main_table": "table", "cabinet_1": "cabinet"},
    objects_of_interest=frozenset({"box_1", "plate_1"}),
    goal=(Relation("On", ("box_1", "plate_1")),),
    placements=dict.fromkeys(("box_1", "plate_1", *CLUTTER), ON_TABLE),
)

REACHER = """
import numpy as np
from pytest_libero_max.policies.contract import PolicySpec


class Reacher:
    spec = PolicySpec(name="reacher", horizon=8, query_interval=4, cameras=(), image_size=64)

    def reset(self, episode):
        pass

    def predict(self, observation, query):
        action = np.zeros(7)
        action[:3] = np.clip((np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]) / 0.05, -1, 1)
        return np.tile(action, (8, 1))


policy = Reacher
"""
"""Moves to where the box begins, so that every event fires, and stays there."""


BUDGET = 12
"""Policy steps of an episode here; the events fire at the third."""


def tiny_manifest(
    inits: tuple[int, ...] = (0,),
    events: tuple[str, ...] = BENCHMARK_EVENTS,
    suites: tuple[str, ...] = ("libero_spatial",),
    task: TaskMetadata = TINY_TASK,
) -> dict[str, Any]:
    records = []
    for suite, init in product(suites, inits):
        identity = Identity("libero", suite, 0, init)
        for name in events:
            for variant in (0, 1):
                records.append(case_record(identity, resolve_event(name, variant, task, identity), task.name))
    protocol = {
        "arms": ["control", "intervention"],
        "query_interval": 16,
        "scoring_track": "physical_completion",
    }
    return {"benchmark_id": "tiny", "benchmark_version": "1.0.0", "protocol": protocol, "cases": records}


@pytest.fixture
def short_sessions(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes of ``BUDGET`` steps in all sessions that pytester starts, in this process or another."""
    shorten_here(monkeypatch, BUDGET)  # what a session in this process changes is put back afterwards
    pytester.syspathinsert()
    monkeypatch.setenv("PYTEST_ADDOPTS", " ".join(short_episodes(pytester, BUDGET)))


@pytest.fixture
def run(pytester: pytest.Pytester, short_sessions: None) -> Callable[..., pytest.RunResult]:
    """Runs pytest on the tiny substrate: the sixteen event variants, an adapter that reaches all of them."""
    pytester.makepyfile(adapter=REACHER)
    pytester.path.joinpath("tiny.json").write_text(json.dumps(tiny_manifest()))

    def go(*args: str, policy: str | None = "adapter.py", subprocess: bool | None = None) -> pytest.RunResult:
        flags = [] if policy is None else [f"--libero-max-policy={policy}"]
        flags += ["--libero-max-manifest=tiny.json", "--libero-max-substrate=tiny"]
        # Gates start a worker, which cannot be started from a session inside of this one.
        gated = any(arg.startswith("--libero-max-gate") for arg in args)
        apart = gated if subprocess is None else subprocess
        runner = pytester.runpytest_subprocess if apart else pytester.runpytest_inprocess
        return runner("-p", "no:cacheprovider", *flags, *args)

    return go


@pytest.fixture
def results(pytester: pytest.Pytester) -> Callable[[], tuple[list[dict[str, Any]], dict[str, Any]]]:
    """The lines of pairs.jsonl after the first, and the report."""

    def read(folder: str = "libero-max-results") -> tuple[list[dict[str, Any]], dict[str, Any]]:
        path = Path(pytester.path, folder)
        lines = [json.loads(line) for line in (path / "pairs.jsonl").read_text().splitlines()]
        return lines[1:], json.loads((path / "report.json").read_text())

    return read
