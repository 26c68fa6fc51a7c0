"""A run says which part of its case set it is, wherever its results are printed."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cli import main
from tests.plugin.conftest import tiny_manifest

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

PAIR = "libero-max::test_pair[libero-spatial-t00-i00-camera_shift-v0]"


def first_line(folder: Path) -> dict[str, Any]:
    line: dict[str, Any] = json.loads((folder / "pairs.jsonl").read_text().splitlines()[0])
    return line


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["plain", "two workers"])
def test_a_part_of_the_cases_is_named_as_such_everywhere(
    run: Run, results: Results, pytester: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    done = run("-k", "camera_shift", "--junitxml=junit.xml", *workers, subprocess=True)
    text = "2 of 16 cases of manifest tiny.json (selection: -k camera_shift)"
    done.stdout.fnmatch_lines(
        [
            "*manifest tiny.json (16 cases, digest *; selection: -k camera_shift), substrate tiny*",
            "reacher (8 actions per query, 4 executed) on tiny, 2 of 16 cases of manifest tiny.json*",
            "*camera_shift):",
        ]
    )
    folder = pytester.path / "libero-max-results"
    header = first_line(folder)["provenance"]["selection"]
    assert (header["asked"], header["chosen"], header["of"]) == (["-k camera_shift"], 2, 16)
    report = results()[1]
    assert report["selection"] == {**header, "whole": False, "missing_shards": [], "text": text}
    assert text in (folder / "report.md").read_text()
    assert text in (folder / "report.html").read_text()
    suite = ET.parse(pytester.path / "junit.xml").getroot().find(".//testsuite/properties")
    assert suite is not None
    properties = {item.get("name"): item.get("value") for item in suite}
    assert properties["libero_max_cases"] == text
    assert properties["libero_max_selection_digest"] == header["digest"]
    assert properties["libero_max_whole_track"] == "false"


def test_every_case_is_the_whole(run: Run, results: Results) -> None:
    run("-k", "libero")
    selection = results()[1]["selection"]
    assert selection["whole"]
    assert "all 16 cases" in selection["text"]


@pytest.mark.parametrize(
    ("arguments", "asked", "chosen"),
    [
        (["--libero-max-limit=3"], ["--libero-max-limit=3"], 3),
        (["-m", "geometry", "-k", "v0"], ["-k v0", "-m geometry"], 2),
        (
            [PAIR],
            [PAIR],
            1,
        ),
        (
            [
                "-k",
                "camera_shift",
                f"--deselect={PAIR}",
            ],
            ["-k camera_shift", f"--deselect={PAIR}"],
            1,
        ),
    ],
)
def test_what_was_asked_for_is_recorded(
    run: Run, results: Results, arguments: list[str], asked: list[str], chosen: int
) -> None:
    run(*arguments)
    selection = results()[1]["selection"]
    assert (selection["asked"], selection["chosen"], selection["whole"]) == (asked, chosen, False)


def test_what_another_plugin_leaves_out_is_a_selection_too(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makeconftest("def pytest_collection_modifyitems(items):\n    del items[2:]\n")
    run()
    selection = results()[1]["selection"]
    assert (selection["chosen"], selection["of"]) == (2, 16)
    assert "by another plugin" in selection["text"]


def test_shards_are_joined_and_a_forgotten_one_is_named(
    run: Run, results: Results, pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    for number in (1, 2, 3):
        run(f"--libero-max-shard={number}/3", "-k", "v0", f"--libero-max-output=part{number}")
    parts = [str(pytester.path / f"part{number}") for number in (1, 2, 3)]
    _, alone = results("part1")
    assert alone["pairs"]["complete"]
    assert alone["selection"]["text"].endswith("(selection: -k v0, shard 1 of 3)")
    capsys.readouterr()
    main(["shards", "merge", parts[0], parts[2], "--output", str(pytester.path / "partial")])
    assert "INCOMPLETE: " in (said := capsys.readouterr().out)
    assert "shard 2/3 not among" in said
    assert not results("partial")[1]["pairs"]["complete"]
    main(["shards", "merge", *parts, "--output", str(pytester.path / "whole")])
    report = results("whole")[1]
    assert report["pairs"]["complete"]
    assert report["selection"]["text"].endswith("tiny.json (selection: -k v0)")


def test_a_manifest_like_a_released_one_is_told_from_it_in_header_and_reports(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    (pytester.path / "tiny.json").write_text(
        json.dumps({**tiny_manifest(), "benchmark_id": "libero-max-8000"})
    )
    text = "like the authors' libero_max_8000.json 3.0.0, but NOT that file: its SHA-256 is another"
    done = run("--libero-max-limit=1")
    done.stdout.fnmatch_lines([f"*manifest tiny.json (16 cases, digest *; {text}*"])
    folder = pytester.path / "libero-max-results"
    assert results()[1]["provenance"]["case_set"]["released_as"] == text
    assert text in (folder / "report.md").read_text()
    assert text.replace("'", "&#39;") in (folder / "report.html").read_text()


@pytest.mark.parametrize("workers", [(), ("-n", "1")], ids=["plain", "one worker"])
def test_options_that_leave_no_case_are_named(run: Run, workers: tuple[str, ...]) -> None:
    done = run("--libero-max-limit=2", "-k", "nosuch", *workers, subprocess=True)
    assert done.ret == pytest.ExitCode.NO_TESTS_COLLECTED
    done.stdout.fnmatch_lines(
        "No pair was chosen: --libero-max-limit=2, -k nosuch leave none of 16 cases. The limit chooses first*"
    )
