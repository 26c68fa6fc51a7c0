"""Whatever is wrong with the pairs of a study, only this package's errors come out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.report.writers.report_files import report_json, write_reports
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import PairStore, read_pairs
from tests.report.studies.studied import Cell, study_of
from tests.runs.damage import damaged

CAMERA = [
    Cell("plus", {"base": True, "reset": False, "dynamic": True}, 1),
    Cell("pro", {"base": True, "reset": True, "dynamic": False}, 1),
]
SWEEP = [Cell("plus", {"base": True, "dynamic": False, "base_q2": True, "dynamic_q2": True}, 2)]


@pytest.mark.parametrize(
    ("cells", "header"),
    [(CAMERA, {"name": "camera-timing"}), (SWEEP, {"name": "cadence", "settings": "2"})],
    ids=["camera-timing", "cadence"],
)
def test_a_damaged_study_is_refused_or_reported(tmp_path: Path, cells: list[Cell], header: Json) -> None:
    planned, records, provenance = study_of(cells, header)
    provenance["protocol"]["strength"] = 0.5
    store = PairStore(tmp_path, Run(tuple(planned), provenance))
    for record in records:
        store.append(structs.replace(record, fingerprints={**record.fingerprints, "strength": "0.5"}))
    store.close()
    path, refused = tmp_path / "pairs.jsonl", 0
    content = path.read_bytes()
    for seed in range(60):
        path.write_bytes(damaged(content, seed))
        try:
            stored = read_pairs(tmp_path)
            replay_command(stored)
            report, _ = write_reports(tmp_path)
            json.loads(report_json(report))
            summary_lines(report)
        except LiberoMaxError:
            refused += 1
    assert 10 < refused < 60
    path.write_bytes(content)
    command = replay_command(read_pairs(tmp_path))
    assert "--libero-max-strength=0.5" in command
    sweep = header.get("settings")
    assert f"--libero-max-study={header['name']}{f':{sweep}' if sweep else ''}" in command
