from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.cli import main, parser
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore
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
    assert main([*arguments, "--output", str(tmp_path / "pages")]) == 0
    assert (tmp_path / "pages" / "comparison.html").exists()


def test_a_run_is_published(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["publish", stored("run", seed=1), str(tmp_path / "published" / "run")]) == 0
    assert "pairs.jsonl.gz" in capsys.readouterr().out
    assert main(["report", str(tmp_path / "published" / "run")]) == 0


def test_power_is_printed_for_expectations_and_for_a_run(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["power", "--base", "0.9", "--change=-0.05"]) == 0
    assert "Pairs needed to resolve a change of -5.0 points" in capsys.readouterr().out
    folder = stored("run", seed=1)
    main(["report", folder])
    assert main(["power", "--run", folder]) == 0
    assert "camera_shift" in capsys.readouterr().out


@pytest.mark.parametrize("command", [["show", "max"], ["--help"], ["show", "smoke", "--json"]])
def test_a_reader_that_goes_away_is_left_in_peace(command: list[str]) -> None:
    script = "import sys; from pytest_libero_max.cli import main; sys.exit(main(sys.argv[1:]))"
    with subprocess.Popen(
        [sys.executable, "-c", script, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    # argparse itself passes over a pipe that is closed while it writes.
    assert process.returncode in ((0, 141) if command == ["--help"] else (141,))


def test_an_interrupted_build_says_how_to_go_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pytest_libero_max.construction.examiner.Examiner", interrupt)
    assert main(["build", str(tmp_path), "--work", "here"]) == 130
    assert capsys.readouterr().err == (
        "libero-max: interrupted. What was examined is kept in here: give the same command again to go on.\n"
    )


def test_tracks_are_certified_by_the_built_in_expert_unless_told_otherwise() -> None:
    assert parser().parse_args(["certify", "there"]).expert == "expert"
    assert parser().parse_args(["certify", "there", "--expert", "mine.py"]).expert == "mine.py"
    with pytest.raises(SystemExit):
        parser().parse_args(["build", "there", "--expert", "mine.py"])
    assert parser().parse_args(["preflight", "smoke"]).expert is None


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
        ["build"],
        ["preflight"],
        ["show"],
    ):
        with pytest.raises(SystemExit, match="0"):
            main([*command, "--help"])
    assert "usage: libero-max" in capsys.readouterr().out


def test_the_published_policies_say_what_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["published"]) == 0
    out = capsys.readouterr().out
    assert "Published results on the genuine substrate" in out
    assert len(out.splitlines()) == 4 + 14


def test_what_can_host_which_event_is_counted(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eligibility"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + 7 + 1 + 10 + 1
    assert lines[1].split()[2:] == ["1076"] * 5 + ["888", "707", "296", "883"]


def test_a_track_and_a_case_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "smoke"]) == 0
    assert "| target_relocation, variant 1 | 2 |" in capsys.readouterr().out
    assert main(["show", "smoke", "--json"]) == 0
    manifest = json.loads(capsys.readouterr().out)
    case_id = manifest["cases"][0]["case_id"]
    assert main(["show", "smoke", case_id]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"{case_id}: ")
    assert '"dynamic_phase": "pre_grasp_proximity"' in shown


def test_a_case_that_is_not_there_is_answered_with_the_closest(capsys: pytest.CaptureFixture[str]) -> None:
    for track in ("smoke", "max"):
        assert main(["show", track, "libero-object-t00-i00-nothing-d0-p195"]) == 1
        error = capsys.readouterr().err
        assert error.startswith(
            "libero-max: case='libero-object-t00-i00-nothing-d0-p195' is not in libero-max-"
        )
        assert "Did you mean '" in error
        assert len(error) < 2500


def test_all_tracks_are_shown_and_verified(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show"]) == 0
    overview = capsys.readouterr().out
    for heading in ("## Tracks", "## Rejected by the preflight", "## Certificates"):
        assert heading in overview
    assert "| max | 8000 | 5600 | 2400 | 0 | 8 |" in overview


def test_the_preflight_of_a_manifest_is_printed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    arguments = ["preflight", "smoke", "--limit", "2", "--jobs", "1", "--work", str(tmp_path)]
    assert main(arguments) == 0
    assert "2 of 2 cases pass the preflight." in capsys.readouterr().out
