"""Wrappers around any policy: from the option to the record, and back to a command."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.errors import AdapterError, OptionError
from pytest_libero_max.evaluation.policy_source import wrapped
from pytest_libero_max.evaluation.resolving import resolve
from pytest_libero_max.evaluation.settings import OPTIONS
from pytest_libero_max.lab.wrappers.restoration import RestoringPolicy
from pytest_libero_max.policies.wrappers import WRAPPERS
from pytest_libero_max.policies.wrapping import WrappedPolicy
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import read_pairs
from tests.pairing.actors import Approaching
from tests.plugin.conftest import REACHER, results, run, short_sessions, tiny_manifest

__all__ = ["results", "run", "short_sessions"]  # fixtures

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

SEES = REACHER.replace("cameras=()", 'cameras=("agentview", "robot0_eye_in_hand")')


@pytest.fixture
def noise(pytester: pytest.Pytester, run: Run) -> Run:
    """Plays the two variants of sensor noise with a policy that asks for both images."""
    pytester.makepyfile(sees=SEES)
    pytester.path.joinpath("tiny.json").write_text(json.dumps(tiny_manifest(events=("sensor_noise_onset",))))
    return lambda *args: run(*args, policy="sees.py")


def test_the_mode_is_in_title_record_and_replay_command(
    pytester: pytest.Pytester, noise: Run, results: Results
) -> None:
    assert noise("--libero-max-wrap=restore:gated").ret == 0
    records, report = results()
    for record in records:
        base, dynamic = (record["arms"][name]["notes"] for name in ("base", "dynamic"))
        assert record["policy"]["wrappers"] == ["restore=gated"]
        assert base["queries"] == record["arms"]["base"]["queries"]
        assert base["active"] == 0
        assert dynamic["active"] == dynamic["queries"] > 0
    assert report["policy"]["wrappers"] == ["restore=gated"]
    folder = Path(pytester.path, "libero-max-results")
    assert "restore=gated" in (folder / "report.md").read_text().splitlines()[0]
    assert "--libero-max-wrap=restore:gated" in replay_command(read_pairs(folder))


def test_a_run_is_not_continued_in_another_mode(noise: Run) -> None:
    assert noise("--libero-max-limit=1").ret == 0
    result = noise("--libero-max-limit=1", "--libero-max-resume", "--libero-max-wrap=restore:always")
    assert result.ret != 0
    result.stdout.fnmatch_lines(["*policy.wrap: None, {'restore': 'always'}. Resume with the same*"])


def test_a_wrapper_is_put_on_by_the_run_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    values = {option.field: option.default for option in OPTIONS} | {"policy": "noop"}
    plain = resolve(values, Path.cwd())
    own = RestoringPolicy(Approaching(cameras=("agentview",)), "gated")
    with pytest.raises(AdapterError, match=r"wrap=restore:gated"):
        wrapped(own, plain)
    asked = replace(plain, wrap={"restore": "always"})
    assert wrapped(own.inner, asked).spec.wrappers == ("restore=always",)
    monkeypatch.setattr(WRAPPERS, "_loaded", {"restore": lambda policy, mode: WrappedPolicy(policy, "x")})
    with pytest.raises(AdapterError, match="begin with restore=always"):
        wrapped(own.inner, asked)


def test_a_policy_without_images_stops_the_run(run: Run) -> None:
    result = run("--libero-max-wrap=restore:gated")
    result.stdout.fnmatch_lines(["*asks for no images*Leave restore out of --libero-max-wrap.*"])
    assert result.ret != 0


def test_an_adaptive_run_has_its_words_in_title_record_and_replay_command(
    pytester: pytest.Pytester, noise: Run, results: Results
) -> None:
    options = ("--libero-max-wrap=adaptive:image", "--libero-max-query-interval=2", "--libero-max-limit=1")
    assert noise(*options).ret == 0
    (record,), report = results()
    notes = record["arms"]["base"]["notes"]
    assert report["policy"]["wrappers"] == ["adaptive=image H=8 Q=2"]
    assert notes["looks"] == record["arms"]["base"]["queries"] == record["arms"]["base"]["steps"]
    assert notes["asked"] < notes["looks"]
    command = replay_command(read_pairs(Path(pytester.path, "libero-max-results")))
    assert {"--libero-max-wrap=adaptive:image", "--libero-max-query-interval=2"} <= set(command)


def test_an_unknown_mode_is_refused_with_those_there_are() -> None:
    (wrap,) = (option for option in OPTIONS if option.field == "wrap")
    with pytest.raises(OptionError, match=r"'restore:sometimes'.* always, gated"):
        wrap.read("restore:sometimes", wrap.flag)


def test_wrappers_are_put_on_in_one_order_whatever_that_of_the_option() -> None:
    (wrap,) = (option for option in OPTIONS if option.field == "wrap")
    both = [wrap.read(text, "") for text in ("restore:gated,adaptive:image", "adaptive:image,restore:gated")]
    assert [[*wrappers.items()] for wrappers in both] == [[("restore", "gated"), ("adaptive", "image")]] * 2
