"""What ``libero-max list profiles``, ``events``, ``programs`` and ``words`` say."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.programs import program_names
from pytest_libero_max.cli import main
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.policies.profile import profile_names
from pytest_libero_max.report.page.words import GLOSSARY


def test_each_profile_has_a_line_with_its_protocol_chunks_and_policy(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["list", "profiles"]) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    assert tuple(lines) == profile_names()
    assert lines["pi05_libero"].split(None, 4)[1:4] == ["openpi", "H=10", "Q=5"]
    assert lines["xvla"].endswith("X-VLA behind its own HTTP server")
    assert max(map(len, lines.values())) <= 145


def test_one_profile_is_explained_with_the_commands_that_use_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "profiles", "pi05_libero"]) == 0
    out = capsys.readouterr().out
    assert "run scripts/serve_policy.py --env LIBERO" in out
    assert "openpi://HOST:PORT --profile pi05_libero" in out
    assert main(["list", "profiles", "openvla_oft_goal"]) == 0
    assert "Suites: libero_goal." in capsys.readouterr().out


WITH_AN_ADAPTER = (
    "served",
    "wrapped",
    "cosmos_policy",
    "fastwam",
    "lightwam",
    "smolvla",
    "molmoact2",
    "robomimic",
)
"""Behind a server that its user writes, like the four whose authors have none, or one that is refused."""


@pytest.mark.parametrize("name", profile_names())
def test_a_profile_says_how_its_server_is_started(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "profiles", name]) == 0
    first, *comment, _, check, play = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{name}: ") or first == name
    assert (check.split()[:2], play.split()[0]) == (["libero-max", "check"], "pytest")
    if name in (*WITH_AN_ADAPTER, "xiaomi_robotics_0", "mimic_video", "himem_wam"):
        return
    commands = [line for line in comment if line.startswith("    ")]
    other = name.startswith("openvla_oft_") or "how it is started is in" in " ".join(comment)
    assert commands or other


def test_a_profile_of_ones_own_is_explained_and_a_wrong_name_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "mine.toml"
    own.write_text('extends = "pi05_libero"\n')
    assert main(["list", "profiles", str(own)]) == 0
    assert capsys.readouterr().out.startswith("mine: H=10 Q=5")
    assert main(["list", "profiles", "pi05_liber"]) == 1
    assert "Did you mean 'pi05_libero'?" in capsys.readouterr().err


def test_each_event_is_described(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "events"]) == 0
    out = capsys.readouterr().out
    found = [line.partition(":")[0] for line in out.splitlines() if not line.startswith(" ")]
    assert found[:8] == list(BENCHMARK_EVENTS)
    assert out.count("Expected: ") == len(found)


def test_programs_are_listed_with_the_cases_that_they_fit(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "programs"]) == 0
    listed = capsys.readouterr().out
    assert all(f"{name}:\n" in listed for name in program_names())
    assert main(["list", "programs", "there_and_back"]) == 0
    shown = capsys.readouterr().out
    assert "event target_relocation or receptacle_relocation: nothing" in shown
    assert '    1. {"trigger": {"type": "untouched"' in shown
    assert shown.endswith("pytest --libero-max-policy=POLICY --libero-max-program=there_and_back\n")
    assert main(["list", "programs", "transiant"]) == 1
    assert "Did you mean 'transient'" in capsys.readouterr().err


def test_words_are_explained_all_or_one(capsys: pytest.CaptureFixture[str]) -> None:
    meanings = tomllib.loads(GLOSSARY.read_text(encoding="utf-8"))
    assert [*meanings] == sorted(meanings, key=str.casefold)
    assert {*"PRGNUEsHQ", "Base", "Dynamic", "substrate", "stale action", "effective tasks"} <= {*meanings}
    assert main(["list", "words"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in listed if not line.startswith(" ")] == [*meanings]
    assert main(["list", "words", "paired change"]) == 0
    assert capsys.readouterr().out.startswith("paired change: ")
    assert main(["list", "words", "stale actions"]) == 1
    assert "mean 'stale action'" in capsys.readouterr().err
