"""Runs that are stopped: by a rule, by something broken, by -x; and the order in which they are played."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from typing import Any

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.report.stopping_rule import BIAS
from pytest_libero_max.runs.status import Follower
from tests.plugin.test_run import Results, Run, identities

RULE = """
from pytest_libero_max.report.stopping_rule import StoppingRule


class Enough(StoppingRule):
    def __init__(self, arguments):
        self.enough = int(arguments)

    def begin(self, planned, gates):
        self.seen = []

    def after(self, pair):
        self.seen.append(pair.item_id)
        return f"{self.seen[-1]} was the last" if len(self.seen) == self.enough else None
"""

SLOW = """
import os
import time
from adapter import Reacher


class Slow(Reacher):
    def reset(self, episode):
        name = os.environ["PYTEST_CURRENT_TEST"].split("i00-")[1].split("]")[0]
        if name in {broken}:
            raise RuntimeError("no")
        if name in {deadly} and not os.path.exists(name):
            open(name, "w").close()
            os._exit(3)
        time.sleep({sleep_s})

policy = Slow
"""


@pytest.fixture
def enough(pytester: pytest.Pytester) -> None:
    """A package with a stopping rule, ``enough:N`` stops after N pairs: one that only a new process finds."""
    pytester.makepyfile(enough=RULE)
    info = pytester.mkdir("enough-1.0.dist-info")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: enough\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pytest_libero_max.stopping_rules]\nenough = enough:Enough\n")


def slow(
    pytester: pytest.Pytester,
    *,
    broken: tuple[str, ...] = (),
    deadly: tuple[str, ...] = (),
    sleep_s: float = 0.0,
) -> str:
    """An adapter; pairs by event and variant fail, or kill their process once."""
    pytester.makepyfile(slow=SLOW.format(broken=broken, deadly=deadly, sleep_s=sleep_s))
    return "slow.py"


def lines_of(pytester: pytest.Pytester) -> list[dict[str, Any]]:
    path = pytester.path / "libero-max-results" / "pairs.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["plain", "n2"])
def test_a_rule_stops_at_the_same_pair_for_any_number_of_workers(
    run: Run, results: Results, pytester: pytest.Pytester, enough: None, workers: tuple[str, ...]
) -> None:
    policy = slow(pytester, sleep_s=0.05)
    rule = "--libero-max-stop=enough:3"
    result = run(rule, "--junitxml=junit.xml", *workers, policy=policy, subprocess=True)
    lines, report = results()
    name = "libero-spatial-t00-i00-distractor_burst-v0"
    stopped = {"reason": f"{name} was the last", "of": 16, "rule": "enough:3", "at": 3}
    assert lines[-1] == {"line": "stopped", **stopped}
    assert report["pairs"]["stopped"] == {**stopped, "watched": [], "bias": BIAS}
    played = report["pairs"]["played"]
    assert played == 3 if not workers else 3 <= played < 16
    assert result.ret == 0
    result.stdout.fnmatch_lines(
        [
            f"STOPPED by rule enough:3 at pair 3 of 16: {name} was the last. {played} of 16 planned pairs *",
            "Exit status 0: the run ended by its stopping rule, which left out * of 16 pairs. *",
        ]
    )
    assert report["provenance"]["stopping_rule"] == "enough:3"
    cases = ET.parse(pytester.path / "junit.xml").getroot().findall(".//testcase")
    assert len(cases) == played
    seen = Follower(pytester.path / "libero-max-results").look()
    assert seen.complete
    assert f"enough:3 at pair 3 of 16: {name} " in seen.lines()[0]


def test_a_stopped_run_goes_on_only_without_its_rule(run: Run, results: Results, enough: None) -> None:
    run("--libero-max-stop=enough:3", subprocess=True)
    before = len(results()[0]) - 1
    again = run("--libero-max-stop=enough:3", "--libero-max-resume", subprocess=True)
    lines, report = results()
    assert sum(line["line"] == "pair" for line in lines) == before
    assert report["pairs"]["stopped"]["at"] == 3
    assert again.ret == 0
    on = run("--libero-max-resume")
    assert on.ret == 0
    assert results()[1]["pairs"]["complete"]
    assert results()[1]["pairs"]["stopped"] is None


def test_a_run_stops_once_its_gate_is_certain_and_has_its_verdict(
    run: Run,
    results: Results,
    pytester: pytest.Pytester,
    capsys: pytest.CaptureFixture[str],
) -> None:
    rule = ("--libero-max-stop=certain", "--libero-max-order=shuffled:1", "--libero-max-gate=base_sr < 50%")
    result = run(*rule, "-n2", "--junitxml=junit.xml", policy=slow(pytester, sleep_s=0.02), subprocess=True)
    lines, report = results()
    verdict = (
        "gate pass  base_sr < 50%: passed, however the last 7 pairs may end: it is at most 43.8% over 16"
    )
    assert lines[-1] == {
        "line": "stopped",
        "reason": lines[-1]["reason"],
        "of": 16,
        "rule": "certain",
        "at": 9,
    }
    assert report["provenance"]["gates"] == ["base_sr < 50%"]
    assert report["overall"]["base_success"]["lower"] is None
    assert report["pairs"]["stopped"]["watched"][0]["verdict"] == "passed"
    result.stdout.fnmatch_lines(
        ["STOPPED by rule certain at pair 9 of 16: *", f"{verdict} pairs*", "Exit status 0:*"]
    )
    before = (pytester.path / "libero-max-results" / "pairs.jsonl").read_bytes()
    again = run(*rule, "--libero-max-resume", "-n2", policy="slow.py", subprocess=True)
    assert again.ret == result.ret == 0
    again.stdout.fnmatch_lines([f"{verdict} pairs*"])
    after = (pytester.path / "libero-max-results" / "pairs.jsonl").read_bytes()
    assert after.startswith(before)
    assert b'"line":"pair"' not in after[len(before) :]
    assert main(["gate", "libero-max-results", "--gate=base_sr < 50%"]) == 0
    assert f"{verdict} pairs" in capsys.readouterr().out


def test_anytime_needs_a_random_order_and_is_said_to(run: Run) -> None:
    result = run("--libero-max-stop=anytime", "--libero-max-order=blocks:7")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(
        ["*--libero-max-stop=anytime: in the order blocks:7 *Add --libero-max-order=shuffled:SEED *"]
    )


def test_a_level_is_declared_before_the_first_pair(run: Run) -> None:
    order = "--libero-max-order=shuffled:2"
    run(order, "-k", "camera_shift")
    result = run(order, "-k", "camera_shift", "--libero-max-stop=anytime", "--libero-max-resume")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--libero-max-stop=anytime: level and gates are declared before *"])


def test_a_rule_that_never_decides_is_said_in_the_header(run: Run) -> None:
    result = run("--libero-max-stop=certain", "--libero-max-gate=whole_track == 1", "--libero-max-limit=1")
    result.stdout.fnmatch_lines(
        ["*stop: certain never stops this run, for no bounds are known of whole_track == 1*"]
    )


def test_a_worker_that_dies_keeps_no_rule_from_its_decision(
    run: Run, results: Results, pytester: pytest.Pytester, enough: None
) -> None:
    policy = slow(pytester, deadly=("camera_shift-v1",), sleep_s=0.05)
    result = run("-n2", "--libero-max-stop=enough:4", policy=policy, subprocess=True)
    lines, report = results()
    assert (lines[-1]["rule"], lines[-1]["at"]) == ("enough:4", 4)
    assert "libero-spatial-t00-i00-camera_shift-v1" in [line.get("item_id") for line in lines]
    assert report["pairs"]["invalid"] == 0
    assert result.ret == 0


def test_errors_stop_a_run_that_is_then_incomplete(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    policy = slow(pytester, broken=("camera_shift-v1", "distractor_burst-v1"))
    result = run("--libero-max-stop=errors:2", policy=policy)
    lines, _ = results()
    assert [line["line"] for line in lines] == ["pair", "error", "pair", "error", "stopped"]
    assert result.ret == 11
    result.stdout.fnmatch_lines(
        [
            "STOPPED by rule errors:2 at pair 4 of 16: 2 pairs could not be measured. 2 of 16 *",
            "Exit status 11: the run is incomplete (2 invalid, 12 missing)*",
        ]
    )


def test_other_tests_are_played_after_a_rule_has_stopped_the_pairs(
    run: Run, pytester: pytest.Pytester, enough: None
) -> None:
    pytester.makepyfile(test_other="def test_other(): pass")
    result = run("libero-max", "test_other.py", "--libero-max-stop=enough:2", subprocess=True)
    result.assert_outcomes(passed=3)


def test_the_first_failure_stops_all_workers(run: Run, results: Results, pytester: pytest.Pytester) -> None:
    policy = slow(pytester, broken=("camera_shift-v0", "receptacle_relocation-v0"), sleep_s=0.3)
    result = run("-n2", "-x", policy=policy, subprocess=True)
    lines, report = results()
    assert lines[-1]["line"] == "stopped"
    assert lines[-1]["rule"] is None
    assert report["pairs"]["played"] <= 4
    assert result.ret == 11
    result.stdout.fnmatch_lines(["INCOMPLETE: *No score. Stopped: *"])


@pytest.mark.parametrize("workers", [(), ("-n2",)], ids=["plain", "n2"])
def test_results_do_not_depend_on_the_order_of_play(
    run: Run, results: Results, pytester: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    run()
    usual, usual_report = results()
    assert usual_report["provenance"]["order"] == "sorted"
    run("--libero-max-order=blocks:7", *workers, subprocess=bool(workers))
    mixed, report = results()
    assert identities(mixed) == identities(usual)
    assert report["overall"] == usual_report["overall"]
    assert report["provenance"]["order"] == "blocks:7"
    planned = [pair["item_id"] for pair in lines_of(pytester)[0]["planned"]]
    played = [line["item_id"] for line in mixed]
    assert planned != sorted(planned)
    assert len({name.split("i00-")[1].rsplit("-", 1)[0] for name in planned[:8]}) == 8
    if workers != ("-n2",):
        assert played == planned
    else:  # each worker holds its pair and the next one
        assert all(abs(played.index(name) - place) <= 4 for place, name in enumerate(planned))


def test_a_run_is_resumed_in_its_order(run: Run) -> None:
    run("--libero-max-order=blocks:7", "-k", "camera_shift")
    result = run("--libero-max-resume", "-k", "camera_shift")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    text = str(result.stdout) + str(result.stderr)
    assert "order blocks:7, " in text


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (
            "--libero-max-order=shuffled",
            "*--libero-max-order='shuffled': expected sorted, blocks:SEED or shuffled:SEED*",
        ),
        ("--libero-max-stop=error:1", "*--libero-max-stop='error:1': *Did you mean 'errors'?*"),
        (
            "--libero-max-stop=errors:none",
            "*--libero-max-stop='errors:none': expected errors:N with an integer*",
        ),
    ],
)
def test_bogus_values_are_refused(run: Run, option: str, message: str) -> None:
    result = run(option)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([message])
