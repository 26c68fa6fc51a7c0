"""A package that adds an event, a probe, a study, a protocol, a command, a format and more."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from tests.plugin.conftest import REACHER

PACKAGE = Path(__file__).with_name("example_package")
REPOSITORY = Path(__file__).parents[2]

MANIFEST = """
import json, pathlib
from tests.plugin.conftest import tiny_manifest
pathlib.Path("tiny.json").write_text(json.dumps(tiny_manifest(events=("camera_shift", "push"))))
"""

RUN = ("--libero-max-policy=adapter.py", "--libero-max-manifest=tiny.json", "--libero-max-substrate=tiny")

Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of packages with the example package in it, and a manifest with its event beside it."""
    place = tmp_path_factory.mktemp("example") / "site"
    place.mkdir()
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]
    info = place / f"libero_max_push-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    groups = (
        "\n".join([f"[{group}]", *(f"{name} = {value}" for name, value in points.items())])
        for group, points in project["entry-points"].items()
    )
    (info / "entry_points.txt").write_text("\n".join(groups))
    for module in PACKAGE.glob("*.py"):
        shutil.copy(module, place)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(place), str(REPOSITORY)])}
    subprocess.run([sys.executable, "-c", MANIFEST], cwd=place.parent, env=environment, check=True)
    return place


@pytest.fixture
def installed(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, short_sessions: None, site: Path
) -> pytest.Pytester:
    """A folder with the example package installed, an adapter, and a manifest with its event."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), str(REPOSITORY)]))
    pytester.makepyfile(adapter=REACHER)
    shutil.copy(site.parent / "tiny.json", pytester.path)
    return pytester


def test_its_probe_is_read_in_every_arm_and_changes_nothing_else(
    installed: pytest.Pytester, results: Results
) -> None:
    how = (*RUN, "-m", "push")
    installed.runpytest_subprocess(*how).assert_outcomes(passed=2)
    plain, _ = results()
    probes = ("--libero-max-probe=fastest_move", "--libero-max-probe=contact_timeline")
    gates = ("--libero-max-gate=fastest_move.way_m.largest <= 0.2", "--libero-max-gate=fast_moves.base > 50%")
    done = installed.runpytest_subprocess(*how, *probes, *gates, "--libero-max-output=probed")
    done.assert_outcomes(passed=2)
    done.stdout.fnmatch_lines(
        ["Fast in dynamic *2/2", "gate pass *fastest_move.way_m.largest*", "gate pass *fast_moves.base*"]
    )
    lines = (installed.path / "probed" / "pairs.jsonl").read_text().splitlines()
    probed = [json.loads(line) for line in lines[1:]]
    ways: dict[str, list[float]] = {"base": [], "dynamic": []}
    for one, other in zip(plain, probed, strict=True):
        for name, arm in other["arms"].items():
            seen = arm["probes"]
            ways[name].append(seen["fastest_move"]["way_m"])
            arm["probes"] = {"stages": seen["stages"]}
            assert 0.0 < seen["fastest_move"]["way_m"] < 0.2
            assert seen["contact_timeline"]["step"][0] == 0
            assert arm == one["arms"][name]
    _, report = results("probed")
    means = {key: column["mean"] for key, column in report["overall"]["probes"].items()}
    assert means == {
        f"fastest_move.way_m.{name}": pytest.approx(sum(seen) / len(seen)) for name, seen in ways.items()
    }
    table = report["sections"]["Fast moves"]
    assert (table["Pairs watched"], table["base moves fast"]["key"]) == (2, "fast_moves.base")
    text = (installed.path / "probed" / "report.md").read_text()
    assert "| fastest_move.way_m.base |" in text
    assert "## Fast moves\n" in text
    assert "<h2>Fast moves</h2>" in (installed.path / "probed" / "report.html").read_text()


def test_a_new_event_is_played_both_ways_and_reported_with_its_command_and_format(
    installed: pytest.Pytester, results: Results
) -> None:
    done = installed.runpytest_subprocess(
        *RUN, "--strict-markers", "-m", "push", "--libero-max-gate=event.push.played == 2", "-n2"
    )
    done.assert_outcomes(passed=2)
    lines, report = results()
    assert {(line["event"], line["family"], line["severity"]) for line in lines} == {
        ("push", "dynamics", "medium"),
        ("push", "dynamics", "high"),
    }
    assert {line["item_id"] for line in lines} == {
        "libero-spatial-t00-i00-push-v0",
        "libero-spatial-t00-i00-push-v1",
    }
    assert list(report["by"]["event"]) == ["push"]
    assert list(report["by"]["family"]) == ["dynamics"]
    for line in lines:
        (firing,) = line["arms"]["dynamic"]["firings"]
        assert firing["evidence"]["operation"] == "push_object"
        assert line["arms"]["base"]["proof"] != line["arms"]["dynamic"]["proof"]

    def run(*words: str) -> str:
        done = installed.run(sys.executable, "-m", "pytest_libero_max.cli", *words)
        assert done.ret == 0
        return done.stdout.str()

    assert run("tally", "one", "two") == "2"
    run("report", "libero-max-results", "--export=tally=tally.txt")
    written = (installed.path / "tally.txt").read_text().splitlines()
    assert [line.split()[0] for line in written] == sorted(line["item_id"] for line in lines)
    proofs = {line["item_id"]: line["arms"]["dynamic"]["proof"] for line in lines}
    installed.runpytest_subprocess(*RUN, "-k", "push", "--libero-max-prefix=replay")
    assert {line["item_id"]: line["arms"]["dynamic"]["proof"] for line in results()[0]} == proofs


def test_the_benchmarks_events_stay_first(installed: pytest.Pytester) -> None:
    done = installed.runpytest_subprocess("--markers", "--libero-max-policy=adapter.py")
    markers = [line.split(":")[0] for line in done.outlines if "LIBERO-MAX pairs with this event" in line]
    assert markers[-1] == "@pytest.mark.push"
    assert markers[:8] == [f"@pytest.mark.{name}" for name in BENCHMARK_EVENTS]
    assert any("@pytest.mark.dynamics" in line for line in done.outlines)


def test_a_manifest_with_an_event_that_is_not_installed_is_refused(
    installed: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    done = installed.runpytest_subprocess(*RUN)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines(["ERROR: *change_type='push' is not an event.*"])


def test_its_stopping_rule_ends_a_run(installed: pytest.Pytester, results: Results) -> None:
    done = installed.runpytest_subprocess(*RUN, "--libero-max-stop=outcomes:persistent_failure:1")
    done.assert_outcomes(passed=1)
    done.stdout.fnmatch_lines(["*ended by its stopping rule, which left out 3 of 4 pairs*"])
    (_, stop), report = results()
    assert stop["reason"] == report["pairs"]["stopped"]["reason"] == "1 pairs end as persistent_failure"


STRATEGY = """
from hypothesis import HealthCheck, given, settings
from pytest_libero_max import strategies
from pytest_libero_max.changes import change_from_dict

@settings(deadline=None, max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(strategies.events(names=["push"]))
def test_drawn(event):
    assert event.name == "push"
    assert change_from_dict(event.change).object == event.entity

@settings(deadline=None, max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(strategies.events())
def test_any(event):
    assert event.family_code
"""


def test_its_strategy_is_among_the_events(installed: pytest.Pytester) -> None:
    installed.makepyfile(test_strategy=STRATEGY)
    installed.runpytest_subprocess("test_strategy.py", "-p", "no:xdist").assert_outcomes(passed=2)


def test_the_preflight_examines_it(installed: pytest.Pytester) -> None:
    path = installed.path / "tiny.json"
    manifest = json.loads(path.read_text())
    (fast,) = (case for case in manifest["cases"] if case["case_id"].endswith("push-d1-p195"))
    fast["scenario"]["change"]["velocity_m_s"] = [
        10 * component for component in fast["scenario"]["change"]["velocity_m_s"]
    ]
    path.write_text(json.dumps(manifest))
    call = "from pytest_libero_max.cli import main; main()"
    command = [
        sys.executable,
        "-c",
        call,
        "dev",
        "preflight",
        "tiny.json",
        "--substrate",
        "tiny",
        "--jobs",
        "1",
    ]
    done = subprocess.run(command, cwd=installed.path, capture_output=True, text=True, check=False)
    assert "3 of 4 cases pass" in done.stdout, done.stdout + done.stderr
    assert f"{fast['case_id']}: box_1 moves by" in done.stdout


LOW = {
    "name": "low",
    "arms": [
        {
            "name": "dynamic",
            "schedule": [{"trigger": {"type": "hand_below", "height_m": 0.6}, "change": "event"}],
        }
    ],
}


def test_its_trigger_is_played_from_a_file(installed: pytest.Pytester, results: Results) -> None:
    installed.path.joinpath("low.json").write_text(json.dumps(LOW))
    installed.runpytest_subprocess(*RUN, "--libero-max-program=low.json").assert_outcomes(passed=4)
    lines, _ = results()
    for line in lines:
        (firing,) = line["arms"]["dynamic"]["firings"]
        assert firing["step"] > 0
        assert line["arms"]["dynamic"]["schedule"][0]["trigger"] == LOW["arms"][0]["schedule"][0]["trigger"]  # type: ignore[index]


def test_its_study_is_played_and_reported(installed: pytest.Pytester, results: Results) -> None:
    done = installed.runpytest_subprocess(
        *RUN, "--libero-max-study=push-early", "--libero-max-gate=played == 4"
    )
    done.stdout.fnmatch_lines(["Study: When it is pushed", "Arm *Success*", "early *0/4"])
    lines, report = results()
    assert [list(line["arms"]) for line in lines] == [["base", "dynamic", "early", "late"]] * 4
    assert (report["study"]["name"], list(report["study"]["arms"])) == (
        "push-early",
        ["base", "dynamic", "early", "late"],
    )
    assert {line["arms"]["early"]["firings"][0]["step"] for line in lines} == {0}


def test_its_protocol_is_spoken(installed: pytest.Pytester, results: Results) -> None:
    installed.path.joinpath("still.toml").write_text(
        'extends = "wrapped"\n[policy]\nname = "still"\nprotocol = "still"\nhorizon = 4\nquery_interval = 4\n'
        '[request]\nprompt = "$instruction"\n'
    )
    flags = (*RUN[1:], "--libero-max-profile=still.toml", "-k", "push-v0")
    installed.runpytest_subprocess("--libero-max-policy=still://anywhere", *flags).assert_outcomes(passed=1)
    ((line,), _) = results()
    assert (line["policy"]["name"], line["policy"]["horizon"]) == ("still", 4)
    examined = ("--libero-max-conform=still://anywhere", "--libero-max-substrate=tiny", flags[-3])
    done = installed.runpytest_subprocess(*examined, "-k", "still and holds")
    done.assert_outcomes(passed=1)
    done.stdout.fnmatch_lines(["policy:still://anywhere was examined in part: 1 kept of 1 rule *"])


def test_what_is_missing_is_named(installed: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    installed.path.joinpath("low.json").write_text(json.dumps(LOW))
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    installed.makepyfile(manifest=MANIFEST.replace('"push"', '"illumination_switch"'))
    subprocess.run([sys.executable, "manifest.py"], cwd=installed.path, check=True)
    for flag, message in (
        ("--libero-max-program=low.json", "*trigger.type='hand_below' is not a trigger.*"),
        ("--libero-max-study=push-early", "*--libero-max-study='push-early': unknown value.*"),
    ):
        done = installed.runpytest_subprocess(*RUN, flag)
        assert done.ret == pytest.ExitCode.USAGE_ERROR
        done.stderr.fnmatch_lines([message])
