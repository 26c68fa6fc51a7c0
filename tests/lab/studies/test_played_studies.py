"""Strength and studies through pytest: options, header, resume, report."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.errors import OptionError
from pytest_libero_max.evaluation.resolving import resolve
from pytest_libero_max.evaluation.settings import OPTIONS
from pytest_libero_max.studies.registry import STUDIES
from tests.plugin.conftest import REACHER, results, run, short_sessions, tiny_manifest

__all__ = ["results", "run", "short_sessions"]  # fixtures

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

CAMERA = ("-m", "camera_shift")


def header(pytester: pytest.Pytester) -> dict[str, Any]:
    path = pytester.path / "libero-max-results" / "pairs.jsonl"
    protocol: dict[str, Any] = json.loads(path.read_text().splitlines()[0])["provenance"]["protocol"]
    return protocol


def test_a_strength_is_in_the_header_the_records_and_the_report(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    done = run(*CAMERA, "--libero-max-strength=0.5")
    done.stdout.fnmatch_lines(["*, strength 0.5", "*, strength 0.5:*"])
    assert header(pytester)["strength"] == 0.5
    records, report = results()
    assert {record["fingerprints"]["strength"] for record in records} == {"0.5"}
    arms = {record["item_id"][-2:]: record["arms"]["dynamic"] for record in records}
    assert arms["v0"]["schedule"][0]["change"]["delta_position_m"] == [0.03, 0.0, 0.01]
    assert report["provenance"]["protocol"]["strength"] == 0.5
    again = run(*CAMERA, "--libero-max-resume", "--libero-max-strength=0.25")
    assert again.ret == pytest.ExitCode.USAGE_ERROR
    again.stdout.fnmatch_lines(["*protocol.strength: 0.5, 0.25*"])


def test_events_that_cannot_be_scaled_are_named_with_a_cure(run: Run) -> None:
    done = run("--libero-max-strength=0.5")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stdout.fnmatch_lines(
        ["*distractor_burst (2 cases), obstacle_insertion (2 cases). Leave them out with -m 'not distractor*"]
    )
    rest = "not distractor_burst and not obstacle_insertion"
    run("-m", rest, "--libero-max-strength=0.5").assert_outcomes(passed=12, deselected=4)


def test_camera_timing_is_played_sharded_resumed_merged_and_reported(
    run: Run, results: Results, pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    manifest = json.dumps(tiny_manifest(events=("camera_shift",)))
    pytester.path.joinpath("tiny.json").write_text(manifest)
    study = ("--libero-max-study=camera-timing",)
    for shard in ("1/2", "2/2"):
        run(*study, f"--libero-max-shard={shard}", f"--libero-max-output=part{shard[0]}")
    assert main(["shards", "merge", "part1", "part2", "--output", "joined"]) == 0
    run(*study)
    stored = pytester.path / "libero-max-results" / "pairs.jsonl"
    kept = stored.read_text().splitlines(keepends=True)[:2]
    stored.write_text("".join(kept))
    other = run("--libero-max-study=camera-strength", "--libero-max-resume")
    assert other.ret == pytest.ExitCode.USAGE_ERROR
    other.stdout.fnmatch_lines(["*protocol.study: *camera-timing*camera-strength*"])
    done = run(*study, "--libero-max-resume", "-n", "2", subprocess=True)
    done.assert_outcomes(passed=1)
    done.stdout.fnmatch_lines(["*, study camera-timing", "Study: Camera timing", "Condition *", "Mid-task *"])
    records, report = results()
    assert [list(record["arms"]) for record in records] == [["base", "dynamic", "reset"]] * 2
    joined = results("joined")[1]
    for part in ("study", "overall"):
        assert joined[part] == report[part]
    assert report["study"]["executed"]["arms"] == 6
    folder = pytester.path / "libero-max-results"
    for name in ("report.md", "report.html"):
        assert "Mid-task - Reset" in (folder / name).read_text()
    assert main(["report", str(folder), "--tables", "--figures"]) == 0
    assert "<title>Camera timing" in (folder / "study-contrasts.svg").read_text()
    capsys.readouterr()


def test_repeats_stay_one_pair_a_case(run: Run, results: Results, pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("tiny.json").write_text(json.dumps(tiny_manifest(events=("camera_shift",))))
    shaking = "+ np.random.default_rng(query.seed).normal(0, 0.001, 3)"
    pytester.makepyfile(adapter=REACHER.replace("/ 0.05, -1, 1)", f"/ 0.05, -1, 1) {shaking}"))
    run("--libero-max-study=repeats:4").assert_outcomes(passed=2)
    records, report = results()
    names = [f"{arm}{play}" for play in ("", "_2", "_3", "_4") for arm in ("base", "dynamic")]
    assert [list(record["arms"]) for record in records] == [names] * 2
    assert header(pytester)["study"] == {"name": "repeats", "settings": "4"}
    table = report["sections"]["Repeats with other policy seeds"]
    assert (table["Cases"], table["Plays of each"]) == (2, 4)
    differing = table["Rollouts that differ from the first play"]
    assert (differing["count"], differing["of"]) == (12, 12)
    assert (report["pairs"]["planned"], report["overall"]["outcomes"]["persistent_failure"]) == (2, 2)


def test_a_latency_is_in_the_header_the_records_and_the_report_and_runs_must_agree_on_it(
    run: Run, results: Results, pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    done = run("--libero-max-limit=2", "--libero-max-latency=160ms")
    done.stdout.fnmatch_lines(["*, latency 4steps*", "*, latency 4steps:*"])
    assert header(pytester)["latency"] == "4steps"
    records, _ = results()
    assert {record["fingerprints"]["latency"] for record in records} == {"4steps"}
    assert {arm["latency"] for record in records for arm in record["arms"].values()} == {"4steps"}
    run("--libero-max-limit=2", "--libero-max-latency=4steps", "--libero-max-resume").assert_outcomes(
        deselected=2
    )
    again = run("--libero-max-limit=2", "--libero-max-resume", "--libero-max-latency=4steps,sync")
    assert again.ret == pytest.ExitCode.USAGE_ERROR
    again.stdout.fnmatch_lines(["*protocol.latency: '4steps', *"])
    run("--libero-max-limit=2", "--libero-max-output=plain")
    assert main(["shards", "merge", "libero-max-results", "plain", "--output", "joined"]) != 0
    assert "protocol.latency: None, '4steps'" in capsys.readouterr().err
    assert main(["compare", "libero-max-results", "plain"]) == 0
    assert "protocol.latency" in capsys.readouterr().out
    again = run("--libero-max-limit=2", "--libero-max-latency=4steps", "--libero-max-prefix=replay")
    again.assert_outcomes(passed=2)
    assert [record["arms"] for record in results()[0]] == [record["arms"] for record in records]


def test_recorded_delays_are_written_out_so_that_they_can_be_played_again(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    first, times = "--libero-max-limit=2", {"40": 30, "120": 10, "390": 2}
    run(first).assert_outcomes(passed=2)
    stored = pytester.path / "libero-max-results" / "pairs.jsonl"
    lines = [json.loads(line) for line in stored.read_text().splitlines()]
    for line in lines[1:]:
        line["timings"]["query_ms"] = {"base": times}
    lines[2]["timings"]["server_waited_s"] = 7.0
    stored.write_text("".join(json.dumps(line) + "\n" for line in lines))
    stored.parent.rename("measured")
    how = ("--libero-max-latency=recorded:measured,sync", "-n1")
    run(first, *how, subprocess=True).assert_outcomes(passed=2)
    written = "1:30+3:10+8:2steps,sync"
    assert header(pytester)["latency"] == written
    records, _ = results()
    assert {arm["latency"] for record in records for arm in record["arms"].values()} == {written}
    again = run(first, f"--libero-max-latency={written}", "--libero-max-output=again")
    again.assert_outcomes(passed=2)
    assert [record["arms"] for record in results("again")[0]] == [record["arms"] for record in records]
    inner = pytester.mkdir("configured")
    (inner / "pytest.ini").write_text("[pytest]\nlibero_max_latency = recorded:../measured,sync\n")
    run(first, "-c", "configured/pytest.ini", "--libero-max-output=beside").assert_outcomes(passed=2)
    beside, _ = results("beside")
    assert {arm["latency"] for record in beside for arm in record["arms"].values()} == {written}
    wrong = run(first, "--libero-max-latency=recorded:nowhere")
    assert wrong.ret == pytest.ExitCode.USAGE_ERROR
    wrong.stderr.fnmatch_lines(["*--libero-max-latency='recorded:nowhere': expected the folder of a run*"])


def test_the_latency_study_plays_its_delays(run: Run, results: Results, pytester: pytest.Pytester) -> None:
    done = run("--libero-max-limit=2", "--libero-max-study=latency:8,2,2sync")
    done.assert_outcomes(passed=2)
    done.stdout.fnmatch_lines(
        ["Study: Latency", "d=0 (0 ms) (own) *", "d=2 (100 ms) *", "d=2 (100 ms) sync *", "d=8 (400 ms) *"]
    )
    records, report = results()
    names = [f"{arm}{end}" for end in ("", "_d8", "_d2", "_d2sync") for arm in ("base", "dynamic")]
    assert [list(record["arms"]) for record in records] == [names] * 2
    assert "latency" not in records[0]["arms"]["base"]
    assert records[0]["arms"]["base_d2sync"]["latency"] == "2steps,sync"
    settings = report["study"]["settings"]
    assert [(setting["steps"], setting["own"]) for setting in settings] == [
        (0, True),
        (2, False),
        (2, False),
        (8, False),
    ]
    assert settings[0]["held"] == 0.0 < settings[1]["held"] < settings[2]["held"]
    assert header(pytester)["study"] == {"name": "latency", "settings": "8,2,2sync"}
    run("--libero-max-limit=2")
    assert header(pytester) == {"prefix": "fork", "noise_floor": None}
    plain, report = results()
    assert "strength" not in plain[0]["fingerprints"]
    assert report["study"] is None
    for record, other in zip(records, plain, strict=True):
        assert {name: record["arms"][name] for name in ("base", "dynamic")} == other["arms"]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"strength": "1.5"}, "from 0 to 1"),
        ({"strength": "nan"}, "from 0 to 1"),
        ({"study": "camera"}, "camera-timing"),
        ({"study": "cadence"}, "cadence:2,4,8"),
        ({"study": "latency"}, "latency:1,2,4,8"),
        ({"study": "latency:0,2"}, "from 1 to 999"),
        ({"study": "latency:2,2"}, "each once"),
        ({"study": "latency:2", "latency": "1steps"}, "delays of its own"),
        ({"latency": "200"}, "'200': "),
        ({"latency": "4steps", "wrap": "adaptive:image"}, "when to ask"),
        ({"study": "cadence:2", "wrap": "adaptive:image"}, "when to ask"),
        ({"study": "camera-strength", "strength": "0.5"}, "strengths of its own"),
    ],
)
def test_options_that_cannot_be_used_are_refused(values: dict[str, str], message: str) -> None:
    with pytest.raises(OptionError, match=re.escape(message)):
        resolve(settings_with(**values), Path.cwd())


def settings_with(**texts: str) -> dict[str, Any]:
    """The default of every option, but for those with these texts."""
    values = {option.field: option.default for option in OPTIONS}
    values |= {
        option.field: option.read(texts[option.field], option.flag)
        for option in OPTIONS
        if option.field in texts
    }
    return values | {"policy": "noop"}


@pytest.mark.parametrize(
    ("flag", "study"), [("--libero-max-cadence=2", "cadence"), ("-olibero_max_delays=2", "latency")]
)
def test_an_old_spelling_is_answered_with_the_new_one(run: Run, flag: str, study: str) -> None:
    done = run(flag)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines([f"*--libero-max-study={study}:SETTINGS*"])


def test_a_camera_study_refuses_cases_with_other_events(run: Run) -> None:
    done = run("--libero-max-study=camera-timing", "-m", "camera_shift or target_relocation")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stdout.fnmatch_lines(["*does not fit*target_relocation (2 cases)*-m 'not target_relocation'*"])


@pytest.mark.parametrize(
    ("study", "track"), [("camera-timing", "camera"), ("cadence:2", "lite"), ("latency:2", "lite")]
)
def test_a_study_has_a_track_of_its_own(study: str, track: str) -> None:
    assert resolve(settings_with(study=study), Path.cwd()).track == track
    assert resolve(settings_with(study=study, track="smoke"), Path.cwd()).track == "smoke"


def test_the_option_names_every_study() -> None:
    (option,) = (option for option in OPTIONS if option.name == "study")
    assert [option.parse(name) for name in STUDIES] == list(STUDIES)
    assert all(name in option.help for name in STUDIES)
