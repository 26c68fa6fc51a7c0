"""Whatever is wrong with a results file, only this package's errors come out, and they name the file."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import LiberoMaxError, ReportError
from pytest_libero_max.report.comparison.compare import compare_runs, read_runs
from pytest_libero_max.report.comparison.comparison_sections import comparison_lines
from pytest_libero_max.report.gate_results import decide
from pytest_libero_max.report.gate_text import gate_lines
from pytest_libero_max.report.gates import parse_gates
from pytest_libero_max.report.writers.power_text import expectations_of
from pytest_libero_max.report.writers.report_files import read_report, report_json, write_reports
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, read_pairs
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plan, record_of, records_of
from tests.runs.damage import damaged

SEEDS = (*range(100), 3675)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    pairs = plan()[:6]
    store = PairStore(tmp_path / "run", Run(tuple(plan()[:8]), PROVENANCE))
    store.append(error_of(pairs[0]))
    store.append(record_of(pairs[1], True, True, **NEVER_TRIGGERED))
    store.append(record_of(pairs[2], True, False, base_repeat={"success": True, "identical": True}))
    for record in records_of(pairs[3:]):
        store.append(record)
    store.close()
    write_reports(tmp_path / "run")
    return tmp_path / "run"


def _use(folder: Path, sound: Path, thoroughly: bool = True) -> None:
    """All that is done with a run; most of it takes much longer than reading."""
    read_pairs(folder)
    if not thoroughly:
        return
    report, _ = write_reports(folder)
    json.loads(report_json(report))
    summary_lines(report)
    gate_lines(decide(parse_gates(["delta >= -0.5", "regressions_vs(sound) <= 1"]), folder, sound.parent))
    comparison_lines(compare_runs(read_runs([folder, sound]), restrict=True), 5)


def _only_our_errors(
    content: bytes, path: Path, use: Callable[[int], object], seeds: Sequence[int] = SEEDS
) -> int:
    refused = 0
    for seed in seeds:
        path.write_bytes(damaged(content, seed))
        try:
            use(seed)
        except LiberoMaxError as error:
            refused += 1
            if path.name not in str(error) and "report" not in str(error):
                pytest.fail(f"seed {seed}: {error} names no file")
        except Exception as error:
            raise AssertionError(f"seed {seed}: {error!r}") from error
    return refused


def test_damaged_pairs_are_read_or_refused(folder: Path) -> None:
    content = (folder / "pairs.jsonl").read_bytes()
    sound = folder.parent / "sound"
    sound.mkdir()
    (sound / "pairs.jsonl").write_bytes(content)

    def use(seed: int) -> None:
        _use(folder, sound, thoroughly=seed % 25 == 0)

    refused = _only_our_errors(content, folder / "pairs.jsonl", use)
    assert refused > 0.5 * len(SEEDS)


def test_damaged_reports_are_read_or_refused(folder: Path) -> None:
    path = folder / "report.json"
    content = json.dumps(json.loads(path.read_text())).encode() + b"\n"
    _only_our_errors(content, path, lambda seed: expectations_of(read_report(folder)), SEEDS[:40])


@pytest.mark.parametrize("changed", [{"by": {}}, {"changed_pairs": None}])
def test_a_report_that_lacks_a_part_is_refused(folder: Path, changed: Json) -> None:
    path = folder / "report.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changed}))
    with pytest.raises(ReportError, match=r"its pairs.jsonl"):
        read_report(folder)


def test_a_count_beyond_all_bounds_is_refused(folder: Path) -> None:
    path = folder / "report.json"
    report = json.loads(path.read_text())
    report["overall"]["played"] = 10**40
    path.write_text(json.dumps(report))
    with pytest.raises(ReportError, match=r"is damaged: "):
        read_report(folder)
