"""Pairs that are played again at the end of a run, in fresh processes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.runs.fresh_place import fresh_place
from pytest_libero_max.runs.run_verification import _differences, chosen
from tests.plugin.conftest import REACHER, tiny_manifest
from tests.report.made_up import plan, record_of

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

ANCHORED = REACHER.replace(
    "        pass", "        self.turn = self.first.setdefault(episode.suite, len(self.first))"
)
ANCHORED = ANCHORED.replace("    def reset", "    first = {}\n\n    def reset")
ANCHORED = ANCHORED.replace("        return", "        action[3] = 0.01 * self.turn\n        return")
"""Keeps for each suite what it was when it first saw it: the same whenever this process asks again."""

SUITES = ("libero_goal", "libero_spatial")


@pytest.fixture
def suites(pytester: pytest.Pytester) -> None:
    manifest = tiny_manifest(events=("camera_shift",), suites=SUITES)
    pytester.path.joinpath("tiny.json").write_text(json.dumps(manifest))


def test_pairs_end_alike_in_a_process_of_their_own(run: Run, results: Results, suites: None) -> None:
    result = run("--libero-max-verify=2")
    result.assert_outcomes(passed=4)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["Played again: 2 of 2 pairs alike in processes and folders of their own*"])
    table = results()[1]["sections"]["Pairs played again"]
    assert list(table.values()) == ["alike", "alike"]


def test_a_published_run_is_played_again_by_those_who_check_it(
    pytester: pytest.Pytester,
    run: Run,
    suites: None,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A success that is altered everywhere agrees with itself, and is found by playing the pair."""
    monkeypatch.setenv("PYTHONPATH", str(pytester.path))  # of the plugin that shortens episodes
    run().assert_outcomes(passed=4)
    assert main(["publish", "pack", "libero-max-results", "published"]) == 0
    check = ["publish", "verify", "published", "--pairs=1", "--seed=7"]
    given = ["--policy=adapter.py", "--cases=tiny.json"]
    assert main(check) == 1
    assert "--policy=adapter.py" in capfd.readouterr().err
    assert main([*check, *given]) == 0
    out = capfd.readouterr().out
    assert "drawn by --seed=7" in out
    assert "Played again: 1 of 1" in out

    pairs = Path("libero-max-results", "pairs.jsonl")
    head, *rest = map(json.loads, pairs.read_text().splitlines())
    drawn = chosen([PairRecord.from_dict(dict(line)) for line in rest], 1, "7")[0].case_id
    altered = next(line for line in rest if line["case_id"] == drawn)
    altered["arms"]["dynamic"]["success"] ^= True
    pairs.write_text("".join(json.dumps(line) + "\n" for line in (head, *rest)))
    assert main(["publish", "pack", "libero-max-results", "published"]) == 0
    assert main([*check, *given]) == 1
    assert "dynamic: success" in capfd.readouterr().out


def test_recorded_actions_are_replayed_where_the_policy_is_not_at_hand(
    pytester: pytest.Pytester, run: Run, suites: None, capfd: pytest.CaptureFixture[str]
) -> None:
    run("--libero-max-traces=all").assert_outcomes(passed=4)
    assert main(["publish", "pack", "libero-max-results", "published", "--actions"]) == 0
    for path in pytester.path.glob("*.py"):
        path.unlink()
    check = ["publish", "verify", "published", "--pairs=2", "--seed=7", "--actions", "--cases=tiny.json"]
    assert main([*check, "--record=verified.json"]) == 0
    out = capfd.readouterr().out
    assert "policy:" not in out
    assert "Played again: 2 of 2" in out
    assert '"actions": true' in Path("verified.json").read_text()
    assert main([*check, "--policy=expert"]) == 1
    assert "--actions asks no policy" in capfd.readouterr().err

    pairs = Path("libero-max-results", "pairs.jsonl")
    head, *rest = map(json.loads, pairs.read_text().splitlines())
    drawn = chosen([PairRecord.from_dict(dict(line)) for line in rest], 1, "7")[0].case_id
    altered = next(line for line in rest if line["case_id"] == drawn)
    altered["arms"]["base"]["success"] ^= True
    pairs.write_text("".join(json.dumps(line) + "\n" for line in (head, *rest)))
    assert main(["publish", "pack", "libero-max-results", "published", "--actions"]) == 0
    Path("verified.json").unlink()
    assert main([*check, "--record=verified.json"]) == 1
    assert "base: success" in capfd.readouterr().out
    assert not Path("verified.json").exists()


def test_a_policy_that_keeps_what_it_saw_first_of_a_suite_is_found(
    pytester: pytest.Pytester, run: Run, suites: None
) -> None:
    pytester.makepyfile(anchored=ANCHORED)
    assert run(policy="anchored.py").ret == 0
    result = run("--libero-max-verify=2", policy="anchored.py")
    result.assert_outcomes(passed=4)
    assert result.ret == 11
    result.stdout.fnmatch_lines(
        [
            "Played again: 1 of 2 pairs *",
            "NOT REPEATED: 1 of 2 pairs *spatial*base: other proof; dynamic: other proof*",
            "Exit status 11: not all pairs that were played again came out alike.",
        ]
    )
    assert "other proof" in (pytester.path / "libero-max-results" / "report.md").read_text()


REMEMBERING = ANCHORED.replace(
    "import numpy as np", "import json\nfrom pathlib import Path\nimport numpy as np"
)
REMEMBERING = REMEMBERING.replace(
    "        self.turn = self.first.setdefault(episode.suite, len(self.first))",
    """        kept = PLACE / "kept.json"
        first = json.loads(kept.read_text()) if kept.exists() else {}
        self.turn = first.setdefault(episode.suite, len(first))
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text(json.dumps(first))""",
)
"""Keeps the same on the disk, where a new process finds it."""


def test_a_policy_that_keeps_it_on_the_disk_is_found(
    pytester: pytest.Pytester, run: Run, suites: None
) -> None:
    pytester.makepyfile(remembering=REMEMBERING.replace("PLACE", "Path.cwd()"))
    result = run("--libero-max-verify=2", policy="remembering.py", subprocess=True)
    assert result.ret == 11
    result.stdout.fnmatch_lines(
        ["NOT REPEATED: 1 of 2 pairs *spatial*other proof*temporary and working folder*"]
    )


def test_a_fresh_place_has_nothing_of_an_earlier_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HOME", "TMPDIR", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    with fresh_place() as (working, environment):
        assert "XDG_CACHE_HOME" not in environment
        folders = [working, Path(environment["HOME"]), Path(environment["TMPDIR"])]
        assert len({*folders}) == 3
        assert not any(list(folder.iterdir()) for folder in folders)


def test_plugins_conftest_files_and_weights_are_found_in_the_new_folders(
    pytester: pytest.Pytester, run: Run, suites: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    hub = pytester.mkdir("hub")
    (hub / "gain.txt").write_text("0.03")
    monkeypatch.setenv("HF_HOME", str(hub))
    pytester.makepyfile(my_plugin="loaded = True")
    pytester.makeconftest("here = True")
    pytester.makepyfile(
        needing=ANCHORED.replace(
            "        self.turn = self.first.setdefault(episode.suite, len(self.first))",
            """        import conftest, my_plugin, os, sys
        assert conftest.here and "my_plugin" in sys.modules
        self.turn = float(open(os.environ["HF_HOME"] + "/gain.txt").read())""",
        ).replace("import conftest, my_plugin", "import conftest")
    )
    result = run("--libero-max-verify=1", "-p", "my_plugin", policy="needing.py", subprocess=True)
    result.stdout.fnmatch_lines(["Played again: 1 of 1 pair alike *"])
    assert result.ret == 0


def test_a_pair_of_a_program_is_played_again(run: Run, suites: None) -> None:
    result = run("--libero-max-verify=1", "--libero-max-program=transient")
    result.stdout.fnmatch_lines(["Played again: 1 of 1 pair alike *"])


def test_a_policy_that_is_not_repeatable_is_not_played_again(
    pytester: pytest.Pytester, run: Run, suites: None
) -> None:
    pytester.makepyfile(other=ANCHORED.replace("image_size=64", "image_size=64, repeatable=False"))
    result = run("--libero-max-verify=2", policy="other.py")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["Played again: no pair. The policy is not repeatable*cannot be judged."])


def test_each_suite_has_its_turn() -> None:
    records = [
        cast("PairRecord", SimpleNamespace(case_id=f"{suite}-{number}", suite=suite))
        for suite in SUITES
        for number in range(5)
    ]
    picked = chosen(records, 4)
    assert sorted(record.suite for record in picked) == sorted(SUITES * 2)
    assert chosen(records[::-1], 4) == picked


def test_a_number_of_pairs_that_is_none_is_refused(run: Run) -> None:
    result = run("--libero-max-verify=some")
    assert result.ret == pytest.ExitCode.USAGE_ERROR


def test_a_pair_that_ends_otherwise_on_another_renderer_names_both() -> None:
    def drawn(mesa: str, dynamic: bool) -> PairRecord:
        prints = {"gl_renderer": "llvmpipe", "gl_version": f"4.5 Mesa {mesa}"} if mesa else {"gl": "egl"}
        return record_of(plan()[0], True, dynamic, fingerprints=prints)

    then = drawn("22.3.6", True)
    other = "dynamic: success True, then False"
    renderers = "images drawn by llvmpipe, OpenGL 4.5 Mesa 22.3.6 then, llvmpipe, OpenGL 4.5 Mesa 26.2.6 here"
    assert _differences(then, drawn("26.2.6", False)) == f"{other}; {renderers}"
    assert _differences(then, drawn("22.3.6", False)) == other
    assert _differences(drawn("", True), drawn("26.2.6", False)) == other  # not recorded then
    assert _differences(then, drawn("26.2.6", True)) == ""
