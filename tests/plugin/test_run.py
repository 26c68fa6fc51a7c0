from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pytest_libero_max.plugin.pairs import test_pair as play_item
from pytest_libero_max.plugin.run_end import RunEnd
from tests.plugin.conftest import BUDGET
from tests.report.made_up import plan, record_of

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]


def identities(lines: list[dict[str, Any]]) -> list[str]:
    """The lines without their timings, in an order that does not depend on the workers."""
    return sorted(str({**line, "timings": None}) for line in lines)


def test_every_pair_is_played_recorded_and_reported(run: Run, results: Results) -> None:
    result = run()
    result.assert_outcomes(passed=16)
    assert result.ret == 0
    lines, report = results()
    assert {line["line"] for line in lines} == {"pair"}
    assert report["pairs"]["planned"] == report["pairs"]["played"] == 16
    assert report["overall"]["trigger_coverage"]["count"] == 16
    for timings in (line["timings"] for line in lines):
        parts = ("world_s", "reset_s", "arm_base_s", "prefix_s", "arm_dynamic_s")
        assert timings["pair_s"] >= sum(timings[name] for name in parts) > 0
    result.stdout.fnmatch_lines(
        ["*libero-max: policy adapter.py*(16 cases, digest *), substrate tiny, prefix fork*"]
    )
    result.stdout.fnmatch_lines(
        [
            "=* libero-max =*",
            "*reacher (8 actions per query, 4 executed) on tiny*",
            "16 of 16 planned pairs played",
            "*pairs.jsonl*",
        ]
    )


@pytest.mark.parametrize(("workers", "prefix"), [("1", "replay"), ("2", "fork")])
def test_workers_and_prefix_modes_give_the_same_records(
    run: Run, results: Results, workers: str, prefix: str
) -> None:
    run("-k", "v1")
    alone, report_alone = results()
    result = run("-k", "v1", f"-n{workers}", f"--libero-max-prefix={prefix}", subprocess=True)
    result.assert_outcomes(passed=8)
    distributed, report = results()
    assert identities(distributed) == identities(alone)
    assert report["overall"] == report_alone["overall"]
    assert report["pairs"]["complete"] is True


@pytest.mark.parametrize("arguments", [(), ("-n2",)], ids=["plain", "distributed"])
def test_junit_carries_the_outcome_of_every_pair(
    run: Run, pytester: pytest.Pytester, arguments: tuple[str, ...]
) -> None:
    run("--junitxml=junit.xml", "-k", "camera_shift", *arguments, subprocess=bool(arguments))
    cases = ET.parse(pytester.path / "junit.xml").getroot().findall(".//testcase")
    assert len(cases) == 2
    for case in cases:
        properties = {item.get("name"): item.get("value") for item in case.findall("./properties/property")}
        assert properties["libero_max_outcome"] == "persistent_failure"
        assert properties["libero_max_triggered"] == "true"


def test_progress_is_a_letter_and_verbose_progress_a_sentence(run: Run) -> None:
    run().stdout.fnmatch_lines(["*NNNNNNNNNNNNNNNN*"])
    run("-v", "-k", "target_relocation-v0").stdout.fnmatch_lines(
        [f"*target_relocation-v0] NEITHER (Base fails after {BUDGET}, event at step *, * stale action*"]
    )


def test_quiet_runs_say_the_headline_what_broke_and_where_the_page_is(run: Run, results: Results) -> None:
    lines = run("-q").outlines
    begin = next(place for place, line in enumerate(lines) if "= libero-max =" in line)
    assert lines[begin + 1].endswith("all 16 cases: 0.0% to 0.0%")
    assert lines[begin + 2].startswith("Not measurable: Base solves 0 of 16 pairs")
    assert lines[begin + 3].startswith("Fix Base first: ")
    assert lines[begin + 4] == "Written: libero-max-results/report.html"
    assert lines[begin + 5].startswith("16 passed")
    assert results()[1]["pairs"]["played"] == 16


@pytest.mark.parametrize("verbosity", [0, -1])
def test_what_was_lost_is_red_and_quiet_runs_keep_the_gates_that_fail(verbosity: int) -> None:
    written: list[tuple[str, dict[str, bool]]] = []

    class Terminal:
        def __init__(self) -> None:
            self.verbosity = verbosity

        def section(self, title: str) -> None: ...

        def write_line(self, line: str, **markup: bool) -> None:
            written.append((line, markup))

    keeper = SimpleNamespace(settings=None)
    end = RunEnd(*cast(Any, (None, keeper, None)))
    end.quiet, end.lines = (
        ["headline"],
        ["all", "R   one", "G   two", "gate FAIL  x", "  lost: one", "Exit status 10"],
    )
    end.pytest_terminal_summary(Terminal())
    gate = [("gate FAIL  x", {"red": True}), ("  lost: one", {}), ("Exit status 10", {})]
    pairs = [("all", {}), ("R   one", {"red": True}), ("G   two", {"green": True})]
    assert written == (pairs if verbosity == 0 else [("headline", {})]) + gate


def test_an_earlier_run_is_set_aside_with_its_traces(run: Run, pytester: pytest.Pytester) -> None:
    for _ in range(3):
        run("-k", "camera_shift and v0", "--libero-max-traces=all")
    folder = pytester.path / "libero-max-results"
    names = sorted(path.name for path in folder.glob("pairs*"))
    assert names == ["pairs.1.jsonl", "pairs.2.jsonl", "pairs.jsonl"]
    assert [path.name for path in (folder / "traces.1").iterdir()] == [
        path.name for path in (folder / "traces").iterdir()
    ]


def test_traces_are_kept_on_request(run: Run, pytester: pytest.Pytester) -> None:
    run("-k", "camera_shift", "--libero-max-traces=all")
    folder = pytester.path / "libero-max-results" / "traces"
    assert len(list(folder.iterdir())) == 2
    with np.load(folder / "libero-spatial-t00-i00-camera_shift-v0.npz") as file:
        trace = dict(file)
    step = int(trace["trigger_step"])
    distance = np.linalg.norm(trace["base_end_effector"] - trace["base_entity"], axis=1)
    assert np.argmax(distance <= 0.18) + 1 == step
    assert (trace["base_actions"][:step] == trace["dynamic_actions"][:step]).all()


def test_a_worker_that_dies_costs_its_pair_and_no_other(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(
        killer="""
        import os
        from adapter import Reacher

        class Killer(Reacher):
            def reset(self, episode):
                if os.path.exists("armed"):
                    os.remove("armed")
                    os._exit(9)

        policy = Killer
        """
    )
    (pytester.path / "armed").touch()
    result = run("-n2", "-k", "v0", "--libero-max-retries=0", policy="killer.py", subprocess=True)
    lines, report = results()
    assert [line["phase"] for line in lines if line["line"] == "error"] == ["crash"]
    assert report["pairs"]["played"] == 7
    assert report["pairs"]["invalid"] == 1
    assert result.ret == 11
    result.stdout.fnmatch_lines(["INCOMPLETE: 7 of 8 planned pairs played*"])


def test_a_pair_that_raises_is_an_error_and_the_others_are_kept(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytester.makepyfile(
        flaky="""
        from adapter import Reacher

        class Flaky(Reacher):
            calls = 0
            def predict(self, observation, query):
                if query.index == 2 and not Flaky.calls:
                    Flaky.calls += 1
                    raise RuntimeError("the camera fell off")
                return super().predict(observation, query)

        policy = Flaky
        """
    )
    result = run(policy="flaky.py")
    result.assert_outcomes(passed=15, errors=1)
    assert result.ret == 11
    result.stdout.fnmatch_lines(["*the camera fell off*", "INCOMPLETE: 15 of 16 planned pairs*No score."])
    lines, report = results()
    errors = [line for line in lines if line["line"] == "error"]
    assert [(error["kind"], error["phase"]) for error in errors] == [("AdapterError", "base")]
    assert report["headline"]["dynamic_success"] is None


def test_strict_fails_regressions_only() -> None:
    strict: Any = SimpleNamespace(strict="regressions")
    lenient: Any = SimpleNamespace(strict=None)
    regression = record_of(plan()[0], base=True, dynamic=False)
    play_item(regression, lenient)
    play_item(record_of(plan()[0], base=False, dynamic=False), strict)
    with pytest.raises(pytest.fail.Exception, match="Base succeeds after"):
        play_item(regression, strict)
