"""Programs from manifests and from a file: played, recorded, reported, and never mixed with one another."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.films.recorded import open_recorded
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import read_pairs
from tests.plugin.conftest import BUDGET, tiny_manifest
from tests.short_episodes import short_episodes

Run = Callable[..., pytest.RunResult]
Results = Callable[[], tuple[list[dict[str, Any]], dict[str, Any]]]

FLASH = [
    {"trigger": "event", "change": "event"},
    {"trigger": {"type": "steps_after", "steps": 4}, "reverts": 0},
]
TRANSIENT = {"name": "transient", "arms": [{"name": "dynamic", "schedule": FLASH}]}
RESET = {
    "name": "timing",
    "arms": [{"name": "reset", "schedule": [{"trigger": {"type": "at_start"}, "change": "event"}]}],
}
SLOWER = {"name": "slower", "arms": [{"name": "base_q8", "cadence": {"query_interval": 8}}]}
LATE = {"name": "late", "arms": [{"name": "base_late", "latency": "2steps,sync"}]}
LATER = {
    "name": "later",
    "arms": [
        {
            "name": "dynamic",
            "schedule": [{"trigger": {"type": "budget_fraction", "value": 0.5}, "change": "event"}],
        }
    ],
}
STACK = {"operation": "set_instruction", "instruction": "stack it"}
REWORD = {"operation": "set_instruction", "instruction": "put it down"}
REWORDED = {
    "name": "reworded",
    "arms": [
        {
            "name": "dynamic",
            "schedule": [
                {"trigger": "event", "change": STACK},
                {"trigger": {"type": "steps_after", "steps": 2}, "change": REWORD},
            ],
        }
    ],
}


@pytest.fixture
def play(pytester: pytest.Pytester, run: Run) -> Run:
    """Runs pytest with a program laid over the cases of some events."""

    def go(program: dict[str, Any], *args: str, events: str = "camera_shift") -> pytest.RunResult:
        pytester.path.joinpath("program.json").write_text(json.dumps(program))
        return run("--libero-max-program=program.json", "-m", events, *args)

    return go


def with_programs(*programs: dict[str, Any], later: bool = True) -> dict[str, Any]:
    """A manifest with a case for each program, and one whose event comes after the grasp."""
    document = tiny_manifest(events=("camera_shift", "target_relocation"))
    first, _, *others = document["cases"]
    cases = [
        {**first, "case_id": f"{first['case_id']}-{program['name']}", "program": program}
        for program in programs
    ]
    for other in others[:later]:
        other["scenario"]["trigger"] = {"type": "after_grasp", "value": "box_1"}
        cases.append(other)
    return {**document, "cases": [first, *cases], "manifest_format": 2}


@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["plain", "two workers"])
def test_a_manifest_of_programs_is_played_and_reported(
    pytester: pytest.Pytester, run: Run, results: Results, workers: tuple[str, ...]
) -> None:
    run("--collect-only")
    document = with_programs(TRANSIENT, RESET, SLOWER, LATER, REWORDED)
    pytester.path.joinpath("tiny.json").write_text(json.dumps(document))
    run(*workers, subprocess=True).assert_outcomes(passed=7)
    lines, report = results()
    arms = {line["item_id"].removeprefix("libero-spatial-t00-i00-"): line["arms"] for line in lines}
    assert {name: list(played) for name, played in arms.items()} == {
        "camera_shift-v0": ["base", "dynamic"],
        "camera_shift-v0-transient": ["base", "dynamic"],
        "camera_shift-v0-timing": ["base", "dynamic", "reset"],
        "camera_shift-v0-slower": ["base", "dynamic", "base_q8"],
        "camera_shift-v0-later": ["base", "dynamic"],
        "camera_shift-v0-reworded": ["base", "dynamic"],
        "target_relocation-v0": ["base", "dynamic"],
    }
    steps = {
        name: [firing["step"] for firing in list(played.values())[-1]["firings"]]
        for name, played in arms.items()
    }
    assert steps == {
        "camera_shift-v0": [3],
        "camera_shift-v0-transient": [3, 7],
        "camera_shift-v0-timing": [0],
        "camera_shift-v0-slower": [],
        "camera_shift-v0-later": [BUDGET // 2],
        "camera_shift-v0-reworded": [3, 5],
        "target_relocation-v0": [],  # nothing is grasped
    }
    plain = arms["camera_shift-v0"]
    assert all(played["base"] == plain["base"] for name, played in arms.items() if name[:6] == "camera")
    assert arms["camera_shift-v0-timing"]["dynamic"] == plain["dynamic"]
    assert arms["camera_shift-v0-slower"]["base_q8"]["queries"] == -(-BUDGET // 8)
    instructions = [
        firing["evidence"]["after"]["instruction"]
        for firing in arms["camera_shift-v0-reworded"]["dynamic"]["firings"]
    ]
    assert instructions == ["stack it", "put it down"]
    assert report["pairs"]["played"] == 7
    (caveat,) = report["caveats"]
    assert (caveat["name"], caveat["pairs"]) == ("program", 5)


def test_a_file_of_a_few_lines_makes_every_event_transient(play: Run, results: Results) -> None:
    done = play(TRANSIENT, events="camera_shift or illumination_switch")
    done.assert_outcomes(passed=4)
    done.stdout.fnmatch_lines(["*libero-max: policy*prefix fork, program transient (*)"])
    lines, report = results()
    for line in lines:
        assert line["item_id"].endswith("-transient")
        first, second = line["arms"]["dynamic"]["firings"]
        assert second["step"] == first["step"] + 4
        values = (first["evidence"]["before"], second["evidence"]["after"])
        assert values[0].items() >= values[1].items() or second["evidence"]["operation"] == "revert"
    program = report["provenance"]["protocol"]["program"]
    assert (program["name"], len(program["digest"])) == ("transient", 64)
    done.stdout.fnmatch_lines(["*program transient (*"])


def test_both_ways_of_playing_a_third_arm_agree(play: Run, results: Results) -> None:
    read = []
    for mode in ("fork", "replay"):
        play(RESET, f"--libero-max-prefix={mode}").assert_outcomes(passed=2)
        read.append([{name: arm["proof"] for name, arm in line["arms"].items()} for line in results()[0]])
    assert read[0] == read[1]
    assert [list(arms) for arms in read[0]] == [["base", "dynamic", "reset"]] * 2
    assert all(len(set(arms.values())) == 3 for arms in read[0])


def test_the_noise_floor_and_a_strength_go_with_a_program(play: Run, results: Results) -> None:
    play(RESET, "--libero-max-noise=floor:16", "--libero-max-strength=0.5").assert_outcomes(passed=2)
    lines, _ = results()
    assert [list(line["arms"]) for line in lines] == [["base", "dynamic", "reset", "base_again"]] * 2
    changes = [line["arms"][name]["schedule"][0]["change"] for line in lines for name in ("dynamic", "reset")]
    assert [change["yaw_degrees"] for change in changes] == [9.0, 9.0, -11.0, -11.0]


def test_runs_of_two_programs_are_never_one(play: Run, run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    play(TRANSIENT, "--libero-max-output=one").assert_outcomes(passed=2)
    longer = json.loads(json.dumps(TRANSIENT).replace('"steps": 4', '"steps": 6'))
    again = play(longer, "--libero-max-output=one", "--libero-max-resume")
    assert again.ret == pytest.ExitCode.USAGE_ERROR
    assert "track, manifest, program" in str(again.stdout)
    play(longer, "--libero-max-output=two").assert_outcomes(passed=2)
    run("-m", "camera_shift", "--libero-max-output=plain").assert_outcomes(passed=2)
    for command in (["shards", "merge", "--output=merged"], ["compare"]):
        for other in ("two", "plain"):
            assert main([*command, "one", other]) == 1
            said = capsys.readouterr().err
            assert "program" in said or "another case" in said, said


def test_a_pair_of_a_program_is_played_again_and_filmed(
    pytester: pytest.Pytester, play: Run, results: Results
) -> None:
    play(RESET, "--libero-max-traces=all").assert_outcomes(passed=2)
    (line, _), _ = results()
    folder = pytester.path / "libero-max-results"
    command = replay_command(read_pairs(folder))
    assert any(word.startswith("--libero-max-program=") for word in command)
    with open_recorded(folder, str(pytester.path / "tiny.json")) as recorded:
        assert recorded.cases[line["case_id"]].digest == line["case_digest"]


def test_a_program_of_the_package_is_named_and_leaves_out_what_it_does_not_fit(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    short_episodes(pytester, 30)  # it ends twenty steps after it began
    asked = ("-m", "camera_shift or target_relocation", "--libero-max-program=transient")
    done = run(*asked)
    done.assert_outcomes(passed=2)
    left_out = (
        "program transient leaves out 4 of 16 cases (2 of target_relocation, 2 of receptacle_relocation): "
    )
    done.stdout.fnmatch_lines([f"{left_out}an object that has moved can be in the hand*"])
    lines, report = results()
    assert [list(line["arms"]) for line in lines] == [["base", "dynamic", "lasting"]] * 2
    for line in lines:
        arms = line["arms"]
        assert arms["dynamic"]["firings"][0] == arms["lasting"]["firings"][0]
        assert len(arms["dynamic"]["firings"]) == 2
    assert report["provenance"]["case_set"]["program"] == "transient"
    assert "--libero-max-program=transient" in replay_command(read_pairs(Path("libero-max-results")))


def test_a_program_that_fits_no_case_is_refused(run: Run) -> None:
    done = run("--libero-max-program=instruction_switch")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines(["ERROR: *'instruction_switch' fits none of 16 cases: the new task needs*"])


@pytest.mark.parametrize(
    ("content", "args", "message"),
    [
        ("{", (), "--libero-max-program: Cannot read program *program.json*"),
        ('{"name": "x"}', (), "--libero-max-program: *program.json: program lacks arms."),
        (
            json.dumps(TRANSIENT).replace("steps_after", "step_after"),
            (),
            "--libero-max-program: case *: program 'transient'.arms[[]0].schedule[[]1].trigger.type="
            "'step_after' is not a trigger. Did you mean 'steps_after'*",
        ),
        (json.dumps(RESET), ("--libero-max-study=event-timing",), "*Leave one of the two out."),
    ],
    ids=["damaged", "incomplete", "unknown trigger", "with a study"],
)
def test_a_program_that_cannot_be_played_is_refused_with_its_file(
    pytester: pytest.Pytester, run: Run, content: str, args: tuple[str, ...], message: str
) -> None:
    pytester.path.joinpath("program.json").write_text(content)
    done = run("--libero-max-program=program.json", *args)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines([f"ERROR: {message}"])


def test_a_manifest_with_a_bad_program_is_named(pytester: pytest.Pytester, run: Run) -> None:
    run("--collect-only")
    bad = json.loads(json.dumps(TRANSIENT).replace('"reverts": 0', '"reverts": 1'))
    pytester.path.joinpath("tiny.json").write_text(json.dumps(with_programs(bad, later=False)))
    done = run()
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines(
        ["ERROR: *tiny.json: case 'libero-*': program 'transient'.arms[[]0]: arm 'dynamic', entry 1: *"]
    )


def test_a_study_is_of_cases_without_a_program(pytester: pytest.Pytester, run: Run) -> None:
    run("--collect-only")
    pytester.path.joinpath("tiny.json").write_text(json.dumps(with_programs(RESET, later=False)))
    done = run("--libero-max-study=event-timing")
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    assert "camera_shift (1 case): they have" in done.stdout.str() + done.stderr.str()


def test_an_arm_of_a_program_has_a_latency_of_its_own(play: Run, results: Results) -> None:
    play(LATE)
    record, _ = results()[0]
    assert record["arms"]["base_late"]["latency"] == "2steps,sync"
    assert "latency" not in record["arms"]["base"]
    play(LATE, "--libero-max-latency=3steps")
    record, _ = results()[0]
    assert [arm["latency"] for arm in record["arms"].values()] == ["3steps", "3steps", "2steps,sync"]
