from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from pytest_libero_max.cli import main, view
from pytest_libero_max.cli.report import rewrite
from pytest_libero_max.errors import OptionError
from pytest_libero_max.films.recorded import chosen, open_recorded
from pytest_libero_max.report import broken
from pytest_libero_max.runs.media import FILM_SELECTIONS, films_in, is_selected, show_command
from pytest_libero_max.runs.store import read_pairs
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.tiny.world import TinySubstrate

from .short_run import SIZE, Played, store

PROJECT = Path(__file__).parents[2]

ELSEWHERE = """
import sys
import pytest
from pytest_libero_max.cli import main
from tests.films.short_run import leave_out_shadows
leave_out_shadows(pytest.MonkeyPatch())
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture
def run(played: Played, tmp_path: Path) -> Path:
    """The folder of a run of one pair, with its trace."""
    return store(played, tmp_path / "run", tmp_path / "tiny.json")


def _film(*arguments: object) -> int:
    cases = [] if "--cases" in arguments else [f"--cases={Path(str(arguments[0])).parent / 'tiny.json'}"]
    return main(["film", *map(str, arguments), *cases, "--size", str(SIZE), "--format", "webp"])


def test_a_run_is_filmed_by_the_names_of_its_pairs(
    run: Path, played: Played, capsys: pytest.CaptureFixture[str]
) -> None:
    item = played.record.item_id
    assert _film(run, item) == 0
    (film,) = (run / "films").iterdir()
    assert film.name == f"{item}--base-dynamic.webp"
    assert f"1/1 {film} (" in capsys.readouterr().out
    before = film.stat().st_mtime_ns
    assert _film(run, played.record.case_id) == 0
    assert "is there already" in capsys.readouterr().out
    assert film.stat().st_mtime_ns == before
    assert _film(run, item, "--overwrite") == 0
    assert film.stat().st_mtime_ns > before


def test_another_process_and_folder_make_the_same_film(run: Path, tmp_path: Path) -> None:
    assert _film(run, "--select=all") == 0
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(run, elsewhere / "copied", ignore=shutil.ignore_patterns("films"))
    cases = f"--cases={tmp_path / 'tiny.json'}"
    command = [sys.executable, "-c", ELSEWHERE, "film", "copied", "--select=all", f"--size={SIZE}", cases]
    subprocess.run(
        [*command, "--format=webp"],
        cwd=elsewhere,
        env={**os.environ, "PYTHONPATH": str(PROJECT)},
        check=True,
        capture_output=True,
    )
    one, other = (next((folder / "films").iterdir()) for folder in (run, elsewhere / "copied"))
    assert one.name == other.name
    assert one.read_bytes() == other.read_bytes()


def test_without_traces_there_is_no_film_and_the_cure_is_said(
    played: Played, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = store(played, tmp_path / "run", tmp_path / "tiny.json", trace=False)
    assert _film(run, "--select=all") == 1
    assert "has no traces" in capsys.readouterr().err
    (run / "traces").mkdir()
    assert _film(run, "--select=all") == 1
    assert "has no trace (" in (out := capsys.readouterr().out)
    assert "--libero-max-traces=all" in out
    assert not (run / "films").exists()


def test_the_cases_of_a_run_can_be_named_where_they_are_now(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    moved = tmp_path / "moved.json"
    (tmp_path / "tiny.json").rename(moved)
    assert main(["film", str(run), "--select=all"]) == 1
    assert "with --cases" in capsys.readouterr().err
    assert _film(run, "--select=all", "--cases", moved) == 0
    assert _film(run, "--select=all", "--cases", "smoke", "--overwrite") == 1
    assert "not among" in capsys.readouterr().out


def test_the_substrate_is_opened_as_the_run_opened_it(
    run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    told = SubstrateOptions((), None, "corrected", "clean", "own")
    described = {
        "name": "libero",
        "roots": ["/a/here"],
        "assets": "/a/models",
        "semantics": "corrected",
        "instruction_source": "clean",
        "source_variations": "own",
    }
    first = json.loads((run / "pairs.jsonl").read_text().splitlines()[0])
    first["provenance"]["substrate"] = described
    (run / "pairs.jsonl").write_text(json.dumps(first) + "\n")
    asked: list[tuple[str, SubstrateOptions]] = []

    def opened(name: str, options: SubstrateOptions) -> TinySubstrate:
        asked.append((name, options))
        return TinySubstrate()

    monkeypatch.setattr("pytest_libero_max.films.recorded.open_substrate", opened)
    cases = str(tmp_path / "tiny.json")
    with open_recorded(run, cases) as recorded:
        assert recorded.outside is not None
        assert "substrate.assets=/a/models" in recorded.outside
    with open_recorded(run, cases, installations=(tmp_path,), assets=tmp_path):
        pass
    with open_recorded(run, cases, for_people=True):
        pass
    elsewhere = replace(told, installations=(tmp_path,), assets=tmp_path)
    assert asked == [("libero", told), ("libero", elsewhere), ("libero", told.for_people())]


def test_a_replay_that_reaches_another_state_is_refused_with_what_differs(
    played: Played, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arms = {name: structs.replace(arm, proof="0" * 64) for name, arm in played.record.arms.items()}
    pair = replace(played.pair, record=structs.replace(played.record, arms=arms))
    versions = {**played.record.fingerprints, "mujoco": "3.3.6"}
    for record, words in (
        (pair.record, "The versions are the same"),
        (structs.replace(pair.record, fingerprints=versions), "Different from then: mujoco 3.3.6 then, "),
    ):
        other = replace(played, pair=replace(pair, record=record))
        run = store(other, tmp_path / words[:3], tmp_path / "tiny.json")
        assert _film(run, "--select=all") == 1
        assert words in capsys.readouterr().out
        assert not list((run / "films").iterdir())


def test_view_films_the_changed_pairs_that_have_traces_and_shows_them(
    run: Path, played: Played, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    item = played.record.item_id
    ran, show = {"case_set": {"path": "tiny.json"}}, "libero-max view out"
    assert show_command(run, "out", [item], ran) == " ".join([show, "--cases=tiny.json"])
    assert show_command(run, "out", [item], {"case_set": {}}) == show
    assert show_command(run, "out", ["another pair"], ran) is None
    monkeypatch.setattr(broken, "to_look_at", lambda report, most: [item])
    view._make_films(run, str(tmp_path / "tiny.json"))
    assert films_in(run).keys() == {item}
    assert not view._page_shows_all(run)
    rewrite(run)
    assert view._page_shows_all(run)
    assert show_command(run, "out", [item], ran) == show


def test_pairs_are_selected_by_outcome_or_by_name(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stored = read_pairs(run)
    (record,) = stored.records
    base, dynamic = record.arms["base"], record.arms["dynamic"]
    expected = {(True, False): FILM_SELECTIONS, (False, True): ("changed", "all"), (False, False): ("all",)}
    for (one, other), names in expected.items():
        arms = {
            "base": structs.replace(base, success=one),
            "dynamic": structs.replace(dynamic, success=other),
        }
        pair = structs.replace(record, arms=arms)
        assert tuple(which for which in FILM_SELECTIONS if is_selected(pair, which)) == names
    assert _film(run) == 0
    assert "No pair" in capsys.readouterr().out
    with pytest.raises(OptionError, match="Did you mean"):
        chosen(stored, [record.item_id[:-1] + "7"], "all")
    assert _film(run, "--select=regression") == 0  # as --libero-max-strict spelt it once
    for parts in ("target_relocation", "geometry and not v1", record.case_id):
        assert chosen(stored, [parts], "all") == [record]
    with pytest.raises(OptionError, match="nor a part"):
        chosen(stored, ["camera_shift"], "all")
    with pytest.raises(OptionError, match="expression="):
        chosen(stored, ["geometry and"], "all")


def test_another_renderer_is_named(
    run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert _film(run, "--select=all") == 0
    assert "Drawn by" not in capsys.readouterr().out
    known = TinySubstrate.fingerprint
    now = dict(known(TinySubstrate(), images=True)) | {"gl": "another", "gl_version": "4.5 Mesa 26.2.6"}
    monkeypatch.setattr(TinySubstrate, "fingerprint", lambda self, images=False: now)
    assert _film(run, "--select=all", "--overwrite") == 0
    out = capsys.readouterr().out
    assert " then, another here" in out
    assert "gl_version" not in out  # the policy of the run sees no images, so that its records do not say
