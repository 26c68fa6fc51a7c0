"""Old less new: a made-up policy that was fitted to the old cases is found out, an able one is not."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import canonical_digest
from pytest_libero_max.cli import main
from pytest_libero_max.errors import ReportError
from pytest_libero_max.lab.comparisons.old_less_new import OldLessNew, document_of, old_less_new
from pytest_libero_max.report.render.terminal import document_lines
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.store import PairStore, StoredRun
from tests.report.made_up import POLICY, PROVENANCE, plan, record_of

OLD = plan(per_cell=5)


def _lines(found: OldLessNew) -> list[str]:
    return document_lines(document_of(found))


def other_cases(pairs: list[PlannedPair]) -> list[PlannedPair]:
    return [
        structs.replace(
            pair,
            case_id=f"new-{pair.case_id}",
            item_id=f"new-{pair.item_id}",
            case_digest=canonical_digest(f"new-{pair.case_id}"),
        )
        for pair in pairs
    ]


NEW = other_cases(OLD)


def run_of(
    pairs: list[PlannedPair], base: float, dynamic: float, track: str, seed: int, **changes: object
) -> RunOutcomes:
    """A run of a policy that succeeds with these chances."""
    return RunOutcomes.of(stored(pairs, base, dynamic, track, seed, **changes))


def stored(
    pairs: list[PlannedPair], base: float, dynamic: float, track: str, seed: int, **changes: object
) -> StoredRun:
    draw = random.Random(seed)
    provenance = {**PROVENANCE, "case_set": {"name": f"track {track}", "digest": "0" * 64}}
    records = tuple(
        record_of(pair, draw.random() < base, draw.random() < dynamic, **changes) for pair in pairs
    )
    return StoredRun(Run(tuple(pairs), provenance), records, (), torn=False)


def judged(old: tuple[float, float], new: tuple[float, float], seed: int = 1) -> OldLessNew:
    return old_less_new(run_of(OLD, *old, "lite", seed), run_of(NEW, *new, "2026Q4/lite", seed + 50))


def test_a_policy_that_was_fitted_to_the_old_cases_is_found_out() -> None:
    found = judged((0.98, 0.95), (0.75, 0.5))
    assert found.arms["Base"].fitted
    assert found.arms["Dynamic"].fitted
    assert found.cells == 32
    lines = _lines(found)
    assert {"lite", "2026Q4/lite,", "32"} <= {*lines[0].split()}
    assert any(line.startswith("Base is over-fitted") for line in lines)
    assert any(line.startswith("Dynamic is over-fitted") for line in lines)


def test_fitting_to_the_events_alone_is_found_in_dynamic_alone() -> None:
    found = judged((0.9, 0.9), (0.9, 0.55))
    assert not found.arms["Base"].fitted
    assert found.arms["Dynamic"].fitted


def test_an_able_policy_is_rarely_called_fitted() -> None:
    """One in twenty would be called fitted or its opposite; of these only the first counts."""
    called = sum(
        any(row.fitted for row in judged((0.8, 0.6), (0.8, 0.6), seed).arms.values()) for seed in range(12)
    )
    assert called <= 2
    found = judged((0.8, 0.6), (0.8, 0.6))
    assert any("no over-fitting" in line for line in _lines(found))


def test_cells_of_one_run_alone_are_left_out() -> None:
    found = old_less_new(
        run_of(OLD, 0.9, 0.9, "lite", 1),
        run_of([pair for pair in NEW if pair.source == "pro"], 0.9, 0.9, "new", 2),
    )
    assert (found.cells, found.left_out) == (16, 80)
    assert any("80 cases" in line for line in _lines(found))


def test_what_cannot_be_compared_is_refused() -> None:
    old, new = run_of(OLD, 0.9, 0.9, "lite", 1), run_of(NEW, 0.9, 0.9, "new", 2)
    with pytest.raises(ReportError, match="share 160 cases"):
        old_less_new(old, old)
    with pytest.raises(ReportError, match=r"scripted .* another"):
        old_less_new(old, run_of(NEW, 0.9, 0.9, "new", 2, policy={**POLICY, "name": "another"}))
    for changed, values, words in (
        ("protocol", {"prefix": "fork", "strength": 0.1}, r"strength \(1\.0 there, 0\.1 here\)"),
        ("versions", {"mujoco": "3.9.0"}, "versions.mujoco"),
    ):
        provenance = new.run.provenance | {changed: values}
        with pytest.raises(ReportError, match=f"also differ in .*{words}"):
            old_less_new(old, replace(new, run=structs.replace(new.run, provenance=provenance)))
    whole = stored(NEW, 0.9, 0.9, "new", 2)
    part = RunOutcomes.of(StoredRun(whole.run, whole.records[:-3], (), torn=False))
    with pytest.raises(ReportError, match="new lacks 3 "):
        old_less_new(old, part)
    assert old_less_new(old, new).cells == 32


def test_the_command_prints_and_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folders = []
    for name, pairs, rate in (("old", OLD, 1.0), ("new", NEW, 0.4)):
        made_up = stored(pairs, rate, rate, name, 3)
        store = PairStore(tmp_path / name, made_up.run)
        for record in made_up.records:
            store.append(record)
        store.close()
        folders.append(str(tmp_path / name))
    assert main(["compare", *folders, "--by-cell", "--json", str(tmp_path / "found.json")]) == 0
    assert "Dynamic is over-fitted" in capsys.readouterr().out
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["arms"]["Base"]["old"] == {"count": 160, "of": 160}
    assert main(["compare", folders[0], "--by-cell"]) != 0
    assert "--by-cell compares two runs" in capsys.readouterr().err
