from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.report.plan import Run
from pytest_libero_max.report.store import PairStore
from tests.report.made_up import PROVENANCE, plan, records_of


@pytest.fixture
def stored(tmp_path: Path) -> Callable[..., str]:
    """Writes a run of made-up pairs and returns its folder."""

    def write(name: str, seed: int) -> str:
        pairs = plan(per_cell=2)
        store = PairStore(tmp_path / name, Run(tuple(pairs), PROVENANCE))
        for record in records_of(pairs, seed=seed):
            store.append(record)
        store.close()
        return str(tmp_path / name)

    return write


def test_a_report_is_recomputed_from_the_pairs_alone(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = stored("run", seed=1)
    assert main(["report", folder, "--figures", "--tables"]) == 0
    assert "64 of 64 planned pairs played" in capsys.readouterr().out
    names = {path.name for path in Path(folder).iterdir()}
    assert {"report.json", "report.md", "report.html", "report.csv", "report.tex"} <= names
    assert {"base-to-dynamic.svg", "base-to-dynamic.png"} <= names


def test_runs_are_compared(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    arguments = ["compare", stored("a", seed=1), stored("b", seed=2), "--json", str(tmp_path / "c.json")]
    assert main(arguments) == 0
    assert "2 runs on 64 common cases" in capsys.readouterr().out
    assert (tmp_path / "c.json").exists()


def test_power_is_printed_for_expectations_and_for_a_run(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["power", "--base", "0.9", "--change=-0.05"]) == 0
    assert "Pairs needed to resolve a change of -5.0 points" in capsys.readouterr().out
    folder = stored("run", seed=1)
    main(["report", folder])
    assert main(["power", "--run", folder]) == 0
    assert "camera_shift" in capsys.readouterr().out


def test_an_error_is_one_line_and_a_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith("libero-max: Cannot read")


def test_everything_has_help(capsys: pytest.CaptureFixture[str]) -> None:
    for command in (
        [],
        ["bench"],
        ["report"],
        ["compare"],
        ["merge"],
        ["power"],
        ["gallery"],
        ["freeze-smoke"],
    ):
        with pytest.raises(SystemExit, match="0"):
            main([*command, "--help"])
    assert "usage: libero-max" in capsys.readouterr().out


def test_the_published_policies_say_what_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["published"]) == 0
    out = capsys.readouterr().out
    assert "Published results on the genuine substrate" in out
    assert len(out.splitlines()) == 4 + 14
