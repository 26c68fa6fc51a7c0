"""Pairs of a policy behind a server: played through its address, also when the server goes and comes back."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.policies.clients.codecs import JSON_NUMPY
from tests.policies.clients import fakes

Run = Callable[..., pytest.RunResult]
Results = Callable[[], tuple[list[dict[str, Any]], dict[str, Any]]]


@pytest.fixture
def blind(pytester: pytest.Pytester) -> str:
    """The option for a profile without images, which take their time."""
    pytester.path.joinpath("blind.toml").write_text(
        'extends = "pi05_libero"\n[request]\n"observation/state" = "$state"\nprompt = "$instruction"\n'
    )
    return "--libero-max-profile=blind.toml"


def reach(request: Any) -> Any:
    """Moves to where the box begins, as the adapter of the other tests does."""
    action = np.zeros(7)
    action[:3] = np.clip((np.array([0.1, -0.1, 0.5]) - request["observation/state"][:3]) / 0.05, -1, 1)
    return {"actions": np.tile(action, (10, 1))}


def test_a_served_policy_plays_pairs_by_its_address(run: Run, results: Results, blind: str) -> None:
    with fakes.openpi(reach) as port:
        result = run(blind, "-k", "distractor_burst", policy=f"openpi://127.0.0.1:{port}")
    result.assert_outcomes(passed=2)
    pairs, report = results()
    assert {pair["policy"]["name"] for pair in pairs} == {"pi05-libero"}
    assert {pair["policy"]["revision"][:13] for pair in pairs} == {"profile blind"}
    assert all(pair["policy"]["horizon"] == 10 for pair in pairs)
    assert report["provenance"]["policy"]["reference"].startswith("openpi://127.0.0.1")


def test_a_policy_of_poses_plays_pairs_and_header_and_records_say_so(run: Run, results: Results) -> None:
    def answer(request: Any) -> Any:
        position = JSON_NUMPY.decode(json.loads(request[1]["proprio"]))[:3]
        goals = position + np.linspace(0.1, 2.5, 30).clip(max=1)[:, None] * (
            np.array([0.1, -0.1, 0.5]) - position
        )
        arms = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.2, *[0.0] * 10], (30, 1))
        arms[:, :3] = goals
        return {"action": arms.tolist()}

    with fakes.http(answer) as port:
        result = run("--libero-max-profile=xvla", "-k", "distractor_burst", policy=f"http://127.0.0.1:{port}")
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(
        ["x-vla (30 actions per query, 30 executed, absolute control, not repeatable) on tiny, *"]
    )
    pairs, report = results()
    assert {pair["policy"]["control"] for pair in pairs} == {"absolute"}
    assert all(pair["arms"]["dynamic"]["firings"] for pair in pairs)
    assert report["policy"]["control"] == "absolute"
    assert report["clipped_actions"]["pairs"] == 0


def test_a_server_that_is_killed_and_started_again_costs_no_pair(
    run: Run, results: Results, blind: str
) -> None:
    asked: list[Any] = []
    stop = threading.Event()

    def handle(request: Any) -> Any:
        asked.append(request)
        if len(asked) == 4:
            stop.set()
            time.sleep(0.2)  # this request has no answer any more
        return reach(request)

    with ExitStack() as servers:
        first = ExitStack()
        port = first.enter_context(fakes.openpi(handle))

        def restart() -> None:
            stop.wait(10)
            first.close()
            time.sleep(0.3)
            servers.enter_context(fakes.openpi(handle, port=port))

        thread = threading.Thread(target=restart)
        thread.start()
        result = run(blind, "-k", "distractor_burst", policy=f"openpi://127.0.0.1:{port}")
        thread.join()
    pairs, _ = results()
    result.assert_outcomes(passed=2)
    assert not [pair for pair in pairs if "kind" in pair]
    result.stdout.fnmatch_lines(["*interrupted server 1."])


def test_a_server_that_stays_away_is_an_error_of_its_pairs_and_no_failure(
    run: Run, results: Results, blind: str
) -> None:
    asked: list[Any] = []

    def handle(request: Any) -> Any:
        asked.append(request)
        return reach(request) if len(asked) < 4 else None

    with fakes.openpi(handle) as port:
        result = run(
            blind,
            "-k",
            "distractor_burst",
            policy=f"openpi://127.0.0.1:{port}?patience=0.3",
        )
    result.assert_outcomes(errors=2)
    assert result.ret == 11
    pairs, _ = results()
    assert {pair["kind"] for pair in pairs} == {"ServerError"}
    result.stdout.fnmatch_lines(["*ServerError: policy server openpi://127.0.0.1:*given up*"])


def test_a_server_that_is_not_there_stops_the_run_after_one_error(run: Run) -> None:
    result = run("--libero-max-profile=pi05_libero", policy="openpi://127.0.0.1:9?patience=0.1")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*the policy cannot be played*"])


@pytest.mark.parametrize(
    ("policy", "arguments", "message"),
    [
        ("openpi://gpu:8000", [], "*Add --libero-max-profile=NAME; for openpi:// there are *pi05_libero*"),
        ("tcp://gpu:10086", [], "*speaks with pickles*none is ever read*"),
        ("adapter.py", ["--libero-max-profile=pi05_libero"], "*Leave --libero-max-profile out*"),
    ],
)
def test_a_bad_address_or_profile_stops_the_run_before_it_begins(
    run: Run, policy: str, arguments: list[str], message: str
) -> None:
    result = run(*arguments, policy=policy)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: {message}"])


def test_the_chunk_that_came_back_and_the_times_of_queries_are_kept(
    pytester: pytest.Pytester, run: Run, results: Results, blind: str
) -> None:
    event, cadence = {"trigger": "event", "change": "event"}, {"query_interval": 2, "horizon": 2}
    arms = [
        {"name": f"{name}_short", "schedule": schedule, "cadence": cadence}
        for name, schedule in (("base", []), ("dynamic", [event]))
    ]
    pytester.path.joinpath("short.json").write_text(json.dumps({"name": "short", "arms": arms}))
    with fakes.openpi(reach) as port:
        result = run(
            blind,
            "-k",
            "distractor_burst",
            "--libero-max-horizon=6",
            "--libero-max-program=short.json",
            policy=f"openpi://127.0.0.1:{port}",
        )
    pairs, report = results()
    assert {tuple(pair["arms"]["base"]["returned"]) for pair in pairs} == {(10, 10)}
    assert report["returned"] == {"least": 10, "most": 10}
    base = pairs[0]["timings"]["query_ms"]["base"]
    assert sum(base.values()) == pairs[0]["arms"]["base"]["queries"]
    result.stdout.fnmatch_lines(
        [
            "libero-max: profile blind is of a policy that draws noise of its own; *20%*",
            "pi05-libero (6 actions of 10 returned per query, 5 executed, not repeatable) on tiny, *",
            "H=10 (cut to 2) Q=2 *",
            "H=10 (cut to 6) Q=5 (own) *",
            "Query times: Base p50 * ms, p95 * ms (* queries); Dynamic p50 *",
        ]
    )


def test_a_server_that_takes_the_published_seeds_is_repeatable_and_gets_them(
    run: Run, results: Results, blind: str
) -> None:
    seeds: list[int] = []

    def handle(request: Any) -> Any:
        seeds.append(request["libero_max_noise_seed"])
        return reach(request)

    with fakes.openpi(handle, {"libero_max_deterministic_noise": True}) as port:
        run(blind, "-k", "distractor_burst", policy=f"openpi://127.0.0.1:{port}")
    pairs, report = results()
    assert {pair["policy_seed"] for pair in pairs} == {195}
    assert seeds[0] == 1729329411
    assert report["policy"]["repeatable"] is True
    assert not any("sham" in pair["arms"] for pair in pairs)
