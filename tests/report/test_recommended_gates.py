"""Gates that the pages and the workflow recommend, on policies that solve nothing, little, half, and most."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest
import yaml

from pytest_libero_max.cli import init
from pytest_libero_max.report.gate_results import decide_on, require_usable
from pytest_libero_max.report.gates import Gate, parse_gates
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.writers.report_files import report_of
from pytest_libero_max.runs.store import StoredRun
from tests.report.made_up import plan, record_of, run_of, write_run

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "AGENTS.md", "docs/how-to/gate-in-ci.md", "docs/how-to/long-runs.md")
WORKFLOW = ROOT / "fixtures" / "github-action" / "workflow.yml"

RATES = {
    "nothing": (0.0, 0.0),
    "little": (7 / 32, 3 / 32),
    "little, and gains": (7 / 32, 7 / 32),
    "half": (0.5, 0.5),
    "most": (30 / 32, 30 / 32),
    "most, and loses a third": (30 / 32, 20 / 32),
}
"""Base and Dynamic success; what Dynamic completes, Base completes too."""


def recommended() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each set of gates with the place that recommends it."""
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        for number, block in enumerate(re.findall(r"libero_max_gate =\n((?: +\S.*\n)+)", text)):
            yield f"{page} {number}", tuple(line.strip() for line in block.splitlines())
        for number, command in enumerate(re.findall(r"^pytest(?:.*\\\n)*.*$", text, re.M)):
            gates = re.findall(r"--libero-max-gate=\"([^\"]+)\"", command)
            if gates:
                yield f"{page} command {number}", tuple(gates)
    (job,) = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))["jobs"].values()
    yield "workflow", tuple(job["steps"][-1]["with"]["gates"].splitlines())
    yield "init", (*init.GATES, init.LATER)


SETS = dict(recommended())


@cache
def played(per_cell: int, policy: str) -> StoredRun:
    planned, (base, dynamic) = plan(per_cell), RATES[policy]
    shares = ((place * 13 % 32) / 32 for place in range(len(planned)))  # spread over the events
    records = [
        record_of(pair, share < base, share < dynamic) for pair, share in zip(planned, shares, strict=True)
    ]
    return run_of(planned, records)


@cache
def report(per_cell: int, policy: str) -> Report:
    return report_of(played(per_cell, policy))


def passes(gates: Sequence[Gate], per_cell: int, policy: str, start: Path) -> bool:
    results = decide_on(gates, played(per_cell, policy), report(per_cell, policy), start)
    return all(result.passed for result in results)


def test_the_pages_recommend_gates() -> None:
    assert {place.partition(" ")[0] for place in SETS} == {
        "README.md",
        "docs/how-to/gate-in-ci.md",
        "docs/how-to/long-runs.md",
        "workflow",
        "init",
    }


@pytest.mark.parametrize("place", SETS)
def test_recommended_gates_pass_what_solves_most_and_nothing_that_solves_less(
    tmp_path: Path, place: str
) -> None:
    gates = parse_gates(SETS[place])
    large = any(gate.end for gate in gates)  # an end of an interval needs the 800 pairs of lite
    per_cell = 25 if large else 1
    for run in {gate.run for gate in gates if gate.run is not None}:
        write_run(tmp_path / run, played(per_cell, "most"))
    require_usable(gates, plan(per_cell), plan(per_cell), tmp_path / "new", tmp_path)
    assert [policy for policy in RATES if passes(gates, per_cell, policy, tmp_path)] == ["most"]


@pytest.mark.parametrize("policy", ["nothing", "little"])
def test_the_gates_to_begin_with_fail_what_solves_little(tmp_path: Path, policy: str) -> None:
    assert not passes(parse_gates(init.GATES), 1, policy, tmp_path)


@pytest.mark.parametrize("policy", ["nothing", "little", "half"])
def test_a_first_run_that_solves_less_is_not_green(tmp_path: Path, policy: str) -> None:
    assert not passes(parse_gates(SETS["workflow"]), 1, policy, tmp_path)
