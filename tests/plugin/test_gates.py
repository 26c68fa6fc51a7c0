from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from pytest_libero_max.plugin import session_setup

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

SHAM, NOISE = "Sham event: other seeds alone", "Noise floor: Base played twice"
"""Sections of the lab."""


def measured(rows: dict[str, Any]) -> dict[str, Any]:
    """The numbers of a section by the names that gates use."""
    return {value["key"]: value for value in rows.values() if isinstance(value, dict)}


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Sessions in this process: that gates have their pairs played by a worker is tested elsewhere."""
    monkeypatch.setattr(session_setup, "_decides_what_it_plays", lambda config: False)
    return partial(run, subprocess=False)


def test_gates_that_hold_leave_the_status_alone(run: Run) -> None:
    result = run("-k", "camera_shift", "--libero-max-gate=stale_mean <= 3", "--libero-max-gate=missing == 0")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["gate pass*stale_mean*", "gate pass*missing*"])


@pytest.mark.parametrize("quiet", [(), ("-q",)], ids=["normal", "quiet"])
def test_a_gate_that_does_not_hold_has_a_status_of_its_own(run: Run, quiet: tuple[str, ...]) -> None:
    result = run("-k", "camera_shift", "--libero-max-gate=dynamic_sr >= 0.6", *quiet)
    assert result.ret == 10
    failed = "  failed: libero-spatial-t00-i00-camera_shift-v0, libero-spatial-t00-i00-camera_shift-v1"
    again = "  again: pytest *libero-spatial-t00-i00-camera_shift-v0*"
    result.stdout.fnmatch_lines(
        ["gate FAIL*dynamic_sr*", failed, again, "Exit status 10: 1 of 1 gate failed."]
    )


@pytest.mark.parametrize("shard", [(), ("--libero-max-shard=1/2",)], ids=["whole", "shard"])
def test_each_gate_is_a_test_case_of_the_junit_file(run: Run, shard: tuple[str, ...]) -> None:
    gates = ("dynamic_sr >= 0.6", "missing == 0", "delta >= -5%")
    options = [f"--libero-max-gate={gate}" for gate in gates]
    result = run("-k", "camera_shift", "--junitxml=junit.xml", *options, *shard)
    assert result.ret == (0 if shard else 10)
    (suite,) = ElementTree.parse("junit.xml").getroot()
    found = {str(case.get("name")): case for case in suite.iter("testcase")}
    outcomes = [{part.tag: part.get("message", "") for part in found[f"gate[{gate}]"]} for gate in gates]
    assert (suite.get("failures"), suite.get("skipped")) == (("0", "3") if shard else ("1", "1"))
    if shard:
        assert all("libero-max shards merge" in outcome["skipped"] for outcome in outcomes)
        return
    failed, passed, undecided = outcomes
    assert "dynamic_sr >= 0.6: failed, it is 0." in failed["failure"]
    assert passed == {}
    assert "delta >= -5%: undecidable" in undecided["skipped"]
    properties = {one.get("name"): one.get("value") for one in suite.findall("properties/property")}
    assert properties["libero_max_status"] == "complete"
    assert properties["libero_max_dynamic_success"] == "0.0"
    assert properties["libero_max_p_value"] == "1.0"


def test_a_gate_decides_the_status_also_of_a_strict_run(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_other="def test_fails(): assert False")
    result = run(
        "-k", "camera_shift or fails", "--libero-max-gate=dynamic_sr >= 0.6", "libero-max", "test_other.py"
    )
    result.stdout.fnmatch_lines(["Exit status 10: 1 of 1 gate failed."])
    assert result.ret == 10


def test_gates_come_from_the_ini_file_too(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nlibero_max_gate =\n    dynamic_sr >= 0.6\n    invalid == 0\n")
    result = run("-k", "camera_shift", subprocess=True)
    assert result.ret == 10
    result.stdout.fnmatch_lines(["Exit status 10: 1 of 2 gates failed."])


def test_an_incomplete_run_is_not_excused_by_its_gates(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(broken="def policy():\n    raise OSError('no weights')\n")
    result = run("-k", "camera_shift", "--libero-max-gate=regressions <= 1", policy="broken.py")
    assert result.ret == 11
    result.stdout.fnmatch_lines(
        ["gate open*", "Exit status 11: the run is incomplete (1 invalid, 1 missing)*"]
    )


def test_a_gate_with_a_typo_stops_the_run_before_it_begins(run: Run) -> None:
    result = run("--libero-max-gate=dynamic_rs >= 0.6", subprocess=False)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: --libero-max-gate=*Did you mean 'dynamic_sr'*"])


@pytest.mark.parametrize(
    ("gate", "words"),
    [
        ("delta >= -15", "can never fail*Write -15% or -0.15"),
        ("regressions <= 3%", "with a percentage, but it is a count"),
        ("suite.libero_spacial.delta >= -0.1", "Did you mean 'libero_spatial'?"),
        ("difficulty.9.delta >= -0.1", "names the difficulty '9', which no case is of"),
        ("regressions_vs(nowhere) <= 3", "the run 'nowhere', which cannot be read"),
        ("regressions_vs(libero-max-results) <= 3", "compares the run with itself"),
        ("regressions_vs(./libero-max-results/pairs.jsonl) <= 3", "compares the run with itself"),
    ],
)
def test_a_gate_that_decides_nothing_stops_the_run_before_it_begins(run: Run, gate: str, words: str) -> None:
    result = run(f"--libero-max-gate={gate}", subprocess=False)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: *{words}*"])
    assert not Path("libero-max-results", "pairs.jsonl").exists()


def test_a_selection_is_no_whole_track(run: Run) -> None:
    result = run("-k", "camera_shift", "--libero-max-gate=missing == 0", "--libero-max-gate=whole_track == 1")
    assert result.ret == 10
    result.stdout.fnmatch_lines(["gate pass*missing*", "gate FAIL*whole_track == 1: failed, it is 0."])


def test_a_group_left_out_of_the_run_fails_at_its_end(run: Run) -> None:
    result = run("-k", "camera_shift", "--libero-max-gate=event.illumination_switch.delta >= -0.1")
    assert result.ret == 10
    result.stdout.fnmatch_lines(["gate open*undecidable*"])


def test_gates_without_a_planned_pair_fail_the_session(run: Run, pytester: pytest.Pytester) -> None:
    test = pytester.makepyfile(test_own="def test_of_the_users_own():\n    pass\n")
    result = run(str(test), "--libero-max-gate=missing == 0")
    result.assert_outcomes(passed=1)
    assert result.ret == 10
    result.stdout.fnmatch_lines(["gate open*no pair was planned*", "Exit status 10: *"])
    assert run(str(test)).ret == 0
    assert run(str(test), "--libero-max-gate=missing == 0", "--collect-only").ret == 0


def test_gates_are_decided_again_on_a_stored_run(
    run: Run, pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    from pytest_libero_max.cli import main

    run("-k", "camera_shift")
    assert main(["gate", "libero-max-results", "--gate", "stale_mean <= 2", "--gate", "invalid == 0"]) == 0
    assert "gate pass  stale_mean <= 2: passed" in capsys.readouterr().out
    assert main(["gate", "libero-max-results", "--gate=dynamic_sr >= 60%", "--gate=missing == 0"]) == 10
    assert "10: 1 of 2 gates failed." in capsys.readouterr().out
    pytester.makeini("[pytest]\nlibero_max_gate =\n    dynamic_sr >= 0.6  # as before\n    invalid == 0\n")
    assert main(["gate", "libero-max-results"]) == 10
    assert "1 of 2 gates" in capsys.readouterr().out


def test_gates_on_a_stored_run_refuse_what_a_session_refuses(
    run: Run, pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    from pytest_libero_max.cli import main

    run("-k", "camera_shift")
    for gate, words in (
        ("delta >= -15", "can never fail"),
        ("event.illumination_switch.delta >= -0.1", "which no case is of"),
        ("regressions_vs(libero-max-results) <= 0", "with itself"),
        ("regressions_vs(nowhere) <= 0", "cannot be read"),
    ):
        assert main(["gate", "libero-max-results", f"--gate={gate}"]) == 1
        assert words in capsys.readouterr().err
    assert main(["gate", "libero-max-results"]) == 1
    assert "gate to decide" in capsys.readouterr().err


def test_an_incomplete_stored_run_has_its_own_status(
    run: Run, pytester: pytest.Pytester, capsys: pytest.CaptureFixture[str]
) -> None:
    from pytest_libero_max.cli import main

    run("-k", "camera_shift")
    pairs = Path("libero-max-results", "pairs.jsonl")
    pairs.write_bytes(b"".join(pairs.read_bytes().splitlines(keepends=True)[:2]))
    assert main(["gate", "libero-max-results", "--gate=regressions <= 1"]) == 11
    out = capsys.readouterr().out
    assert "open  regressions <= 1: undecidable" in out
    assert "INCOMPLETE: 1 of 2 planned" in out


def test_on_github_failed_gates_are_annotated_and_summarised(
    run: Run, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    summary = pytester.path / "summary.md"
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    result = run("-k", "camera_shift", "--libero-max-gate=dynamic_sr >= 0.6")
    result.stdout.fnmatch_lines(["::error title=LIBERO-MAX gate failed::*"])
    assert "| `dynamic_sr >= 0.6` | **violated** | 0 |" in summary.read_text()
    assert "# reacher" in summary.read_text()


def test_a_run_is_gated_against_an_earlier_one(run: Run) -> None:
    run("-k", "camera_shift", "--libero-max-output=before")
    result = run("-k", "camera_shift", "--libero-max-output=after", "--libero-max-gate=gains_vs(before) <= 1")
    assert result.ret == 10
    result.stdout.fnmatch_lines(["gate open*undecidable, Base solves 0 of 2 pairs*"])


def test_a_policy_that_fails_everything_passes_no_gate_on_the_change(run: Run) -> None:
    gates = ["delta.lower >= -15%", "regressions <= 3", "conditional_regression <= 10%", "p_value > 0.05"]
    result = run(*(f"--libero-max-gate={gate}" for gate in gates))
    assert result.ret == 10
    result.stdout.fnmatch_lines(
        ["Not measurable: Base solves 0 of 16 pairs*"] + [f"gate open*{gate}*undecid*" for gate in gates]
    )
    assert "gate pass" not in result.stdout.str()


@pytest.mark.parametrize(
    ("gate", "words"),
    [
        ("event.camera_shift.delta.lower >= -15%", "no outcome of its 2 pairs can meet it"),
        ("base_sr.lower >= 90%", "no outcome of its 16 pairs"),
        ("equivalent_vs(before, 5%)", "no outcome of its 16 pairs"),
    ],
)
def test_a_gate_that_no_outcome_can_meet_is_refused_before_anything_plays(
    run: Run, gate: str, words: str
) -> None:
    if "before" in gate:
        run("--libero-max-output=before")
    result = run(f"--libero-max-gate={gate}", subprocess=False)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"*{words}*"])


@pytest.mark.parametrize("workers", ["0", "2"])
def test_a_run_is_resumed_where_it_stopped(
    run: Run, results: Results, pytester: pytest.Pytester, workers: str
) -> None:
    run("--libero-max-output=whole")
    run("--libero-max-output=part")
    pairs = Path(pytester.path, "part", "pairs.jsonl")
    lines = pairs.read_bytes().splitlines(keepends=True)
    pairs.write_bytes(b"".join(lines[:9]) + lines[9][:100])  # the plan, eight pairs, and a torn ninth
    result = run("--libero-max-output=part", "--libero-max-resume", f"-n{workers}", subprocess=True)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["*8 measured before*"])
    whole, part = results("whole"), results("part")
    assert sorted(line["case_id"] for line in part[0]) == sorted(line["case_id"] for line in whole[0])
    for name in ("overall", "by", "pairs"):
        assert part[1][name] == whole[1][name]


def test_a_merged_run_is_resumed(run: Run) -> None:
    from pytest_libero_max.cli import main

    for number in "12":
        run(f"--libero-max-shard={number}/2", f"--libero-max-output={number}")
    assert main(["shards", "merge", "1", "2", "--output=merged"]) == 0
    result = run("--libero-max-output=merged", "--libero-max-resume", "-n2", subprocess=True)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["*16 of 16 planned pairs played"])
    result.stdout.no_fnmatch_line("*2 workers*")  # nothing is left for them


def test_resuming_a_finished_run_plays_nothing_and_is_fine(run: Run) -> None:
    run("-k", "camera_shift")
    result = run("-k", "camera_shift", "--libero-max-resume")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["2 of 2 planned pairs played"])


def test_the_ini_file_can_ask_for_resuming(run: Run, pytester: pytest.Pytester) -> None:
    run("-k", "camera_shift")
    pytester.makeini("[pytest]\nlibero_max_resume = true\n")
    result = run("-k", "camera_shift")
    result.stdout.fnmatch_lines(["*2 measured before*"])


def test_resuming_is_asked_for_with_true_or_false(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nlibero_max_resume = perhaps\n")
    result = run("-k", "camera_shift")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: ini option libero_max_resume:*perhaps*expected true or false"])


def test_another_run_is_not_resumed(run: Run) -> None:
    run("-k", "camera_shift")
    result = run("-k", "camera_shift", "--libero-max-resume", "--libero-max-prefix=replay")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert "--libero-max-resume" in result.stdout.str() + result.stderr.str()


def test_shards_make_up_the_whole(run: Run, pytester: pytest.Pytester) -> None:
    from pytest_libero_max.cli import main

    run("--libero-max-output=whole")
    for shard in ("1/3", "2/3", "3/3"):
        run(f"--libero-max-shard={shard}", f"--libero-max-output={shard[0]}")
    assert main(["shards", "merge", "1", "2", "3", "--output", "merged"]) == 0
    assert main(["gate", "merged", "--gate=whole_track == 1", "--gate=missing == 0"]) == 0
    assert main(["gate", "1", "--gate=whole_track == 1"]) == 10
    whole, merged = (json.loads(Path(name, "report.json").read_text()) for name in ("whole", "merged"))
    for name in ("overall", "by", "pairs"):
        assert merged[name] == whole[name]


def test_the_noise_floor_of_a_policy_that_repeats_itself_is_zero(run: Run, results: Results) -> None:
    pytest.importorskip("pytest_libero_max.lab.sections.sham")
    result = run("-k", "v0", "--libero-max-noise=floor:4")
    noise = measured(results()[1]["sections"][NOISE])
    assert noise["noise_floor.flips"]["count"] == 0
    assert noise["noise_floor.identical"]["count"] == noise["noise_floor.flips"]["of"] > 0
    result.stdout.fnmatch_lines(
        ["*asked for on 4 pairs, and measured on 2.", "Noise floor: Base played twice  0.0% *"]
    )


def test_the_noise_floor_shows_a_policy_that_does_not(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytest.importorskip("pytest_libero_max.lab.sections.sham")
    pytester.makepyfile(
        noisy="""
        import numpy as np
        from pytest_libero_max.policies.contract import PolicySpec

        class Noisy:
            spec = PolicySpec("noisy", cameras=(), repeatable=False)
            calls = 0

            def reset(self, episode):
                pass

            def predict(self, observation, query):
                Noisy.calls += 1
                return np.full((1, 7), Noisy.calls % 7 / 10)

        policy = Noisy
        """
    )
    run("-k", "camera_shift", "--libero-max-noise=floor:16", policy="noisy.py")
    alike = measured(results()[1]["sections"][NOISE])["noise_floor.identical"]
    assert alike["count"] < alike["of"] == 2


def test_a_sham_event_shows_what_is_lost_by_chance(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytest.importorskip("pytest_libero_max.lab.sections.sham")
    pytester.makepyfile(
        seeded="""
        import numpy as np
        from pytest_libero_max import PolicySpec

        class Seeded:
            spec = PolicySpec("seeded", cameras=())

            def reset(self, episode):
                pass

            def predict(self, observation, query):
                action = np.random.default_rng(query.seed).uniform(-0.1, 0.1, (1, 7))
                action[0, :3] += (np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]) / 0.05
                return np.clip(action, -1, 1)

        policy = Seeded
        """
    )
    result = run("-k", "v0", "--libero-max-noise=sham:1", policy="seeded.py")
    sham = results()[1]["sections"][SHAM]
    assert sham["Pairs"] == 8
    assert measured(sham)["sham.identical"]["count"] == 0
    result.stdout.fnmatch_lines(["Lost to other seeds *"])
    run("-k", "v0", "--libero-max-noise=sham:1", "--libero-max-output=again", policy="seeded.py")
    assert results("again")[1]["sections"][SHAM] == sham
    run("-k", "v0", "--libero-max-noise=sham:1", "--libero-max-output=fixed")
    fixed = measured(results("fixed")[1]["sections"][SHAM])
    assert (fixed["sham.identical"]["count"], fixed["sham.identical"]["of"]) == (8, 8)
    assert fixed["sham.floor"]["value"] == 0.0


def test_a_policy_that_draws_noise_of_its_own_is_called_so_and_measured(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    pytest.importorskip("pytest_libero_max.lab.sections.sham")
    pytester.makepyfile(
        noisy="""
        import numpy as np
        from pytest_libero_max import PolicySpec

        class Noisy:
            spec = PolicySpec("noisy", cameras=(), repeatable=False)

            def __init__(self):
                self.random = np.random.default_rng(0)

            def reset(self, episode):
                pass

            def predict(self, observation, query):
                action = self.random.uniform(-0.1, 0.1, (1, 7))
                action[0, :3] += (np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]) / 0.05
                return np.clip(action, -1, 1)

        policy = Noisy
        """
    )
    result = run(policy="noisy.py")
    pairs, report = results()
    both = [pair for pair in pairs if {"sham", "sham_dynamic"} <= pair["arms"].keys()]
    assert 0 < len(both) == report["sections"][SHAM]["Pairs"] < len(pairs)
    assert all(pair["arms"]["sham_dynamic"]["proof"] != pair["arms"]["dynamic"]["proof"] for pair in both)
    for pair in both:
        firings = pair["arms"]["sham_dynamic"]["firings"]
        assert [firing["step"] for firing in firings] == [pair["arms"]["dynamic"]["firings"][0]["step"]] * 2
    assert measured(report["sections"][SHAM])["sham.flips"]["of"] == len(both)
    result.stdout.fnmatch_lines(
        [
            "noisy (1 action per query, 1 executed, not repeatable) on tiny, *",
            "NOT REPEATABLE: *",
            "Base and Dynamic differ *",
            "... by chance *0.0%*",
            "... beyond chance *",
        ]
    )
    for name in ("report.md", "report.html"):
        assert "NOT REPEATABLE" in (pytester.path / "libero-max-results" / name).read_text()
    result = run("--libero-max-noise=sham:0", "--libero-max-output=bare", policy="noisy.py")
    result.stdout.fnmatch_lines(["*--libero-max-noise=sham:1."])
    assert SHAM not in results("bare")[1]["sections"]
