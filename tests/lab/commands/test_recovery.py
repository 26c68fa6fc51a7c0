from __future__ import annotations

import json
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.lab.recovery import compare_recovery, document_of
from pytest_libero_max.report.render.terminal import document_lines
from pytest_libero_max.runs.store import PairStore
from tests.lab.test_recovery import GATED, NATIVE
from tests.report.made_up import plain


def test_the_command_reads_folders_in_any_order(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folders = []
    for name, run in (("b", GATED), ("a", NATIVE)):
        store = PairStore(tmp_path / name, run.run)
        for record in run.records:
            store.append(record)
        store.close()
        folders.append(str(tmp_path / name))
    assert main(["lab", "recovery", *folders, "--json", str(tmp_path / "recovery.json")]) == 0
    printed = capsys.readouterr().out
    written = json.loads((tmp_path / "recovery.json").read_text(encoding="utf-8"))
    assert printed == "\n".join(document_lines(document_of(compare_recovery([NATIVE, GATED])))) + "\n"
    assert written["effects"] == plain(compare_recovery([NATIVE, GATED]))["effects"]
