"""Pairs of a policy behind several servers, of which some die."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from pytest_libero_max.runs.merge import merge_folders
from tests.plugin.conftest import tiny_manifest
from tests.plugin.test_servers import reach
from tests.policies.clients import fakes
from tests.policies.peers.conftest import peer, require
from tests.policies.server.policies import Counting

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

BLIND = {
    "openpi": 'extends = "pi05_libero"\n[request]\n"observation/state" = "$state"\nprompt = "$instruction"\n',
    "vla-eval": 'extends = "vla_eval_pi05"\n[request]\ntask = { name = "$instruction" }\n'
    'observation = { images = {}, task_description = "$instruction", states = "$state" }\n',
}
"""Profiles without images, which take their time."""


def identities(lines: list[dict[str, Any]]) -> dict[str, Any]:
    """The pairs by case, without what differs between runs."""
    return {line["case_id"]: PairRecord.from_dict(line).identity() for line in lines if "arms" in line}


@contextmanager
def killed_after(pairs: int, path: Path, server: ExitStack) -> Iterator[None]:
    """Ends a server once so many pairs are stored."""
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(0.02):
            if path.is_file() and path.read_bytes().count(b"\n") > pairs:
                server.close()
                return

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.mark.parametrize(
    ("module", "script", "scheme"),
    [
        ("openpi.serving", ("openpi_server.py",), "openpi"),
        ("vla_eval", ("vla_eval_server.py", "reach", "10"), "vla-eval"),
    ],
)
def test_a_published_server_of_a_suite_dies_and_the_records_are_those_of_one_server(
    module: str,
    script: tuple[str, ...],
    scheme: str,
    run: Run,
    results: Results,
    pytester: pytest.Pytester,
) -> None:
    require(module)
    pytester.path.joinpath("blind.toml").write_text(BLIND[scheme])
    manifest = tiny_manifest(
        events=("camera_shift", "distractor_burst", "illumination_switch"),
        suites=("libero_spatial", "libero_goal"),
    )
    pytester.path.joinpath("suites.json").write_text(json.dumps(manifest))
    how = (
        "--libero-max-profile=blind.toml",
        "--libero-max-revision=weights-7",
        "--libero-max-manifest=suites.json",
    )
    with ExitStack() as servers:
        ports = [servers.enter_context(peer(*script)) for _ in range(2)]
        mortal = servers.enter_context(ExitStack())
        ports.insert(0, mortal.enter_context(peer(*script)))
        addresses = [f"{scheme}://127.0.0.1:{port}?patience=0.5" for port in ports]
        first, second, third = addresses
        pytester.path.joinpath("map.toml").write_text(
            f'[[servers]]\nfor = ["libero_goal"]\naddresses = ["{first}", "{second}"]\n'
            f'[[servers]]\naddress = "{third}"\n'
        )
        run(*how, policy=second).assert_outcomes(passed=12)
        alone, _ = results()
        store = pytester.path / "several" / "pairs.jsonl"
        with killed_after(3, store, mortal):
            result = run(*how, "-n3", "--libero-max-output=several", policy="map.toml", subprocess=True)
    result.assert_outcomes(passed=12)
    result.stdout.fnmatch_lines(
        [
            f"libero-max: 3 servers: {first}, {second} for libero_goal; {third} for all other pairs",
            f"Policy server {first} was left out: *. {second} answered instead.",
        ]
    )
    assert "not measured" not in result.stdout.str()
    lines = [json.loads(line) for line in store.read_text().splitlines()]
    assert identities(lines[1:]) == identities(alone)
    assert lines[0]["provenance"]["policy"]["servers"][0]["addresses"] == [first, second]
    used: dict[str, set[str]] = {suite: set() for suite in ("libero_goal", "libero_spatial")}
    for line in lines[1:]:
        used[line["suite"]].add(line["timings"]["server"])
    assert second in used["libero_goal"] <= {first, second}
    assert used["libero_spatial"] == {third}


def test_a_pair_whose_memory_was_on_a_dead_server_is_played_again(run: Run, results: Results) -> None:
    how = ("--libero-max-profile=served", "-k", "camera_shift or light")
    with ExitStack() as servers:
        mortal, (port, _) = ExitStack(), servers.enter_context(serving(Host(Counting(), "x"), port=0))
        first, _ = mortal.enter_context(serving(Host(Counting(), "x"), port=0))
        one, other = f"openpi://127.0.0.1:{first}?patience=0.3", f"openpi://127.0.0.1:{port}"
        run(*how, policy=other)
        alone, _ = results()
        with killed_after(1, Path("several/pairs.jsonl"), mortal):
            result = run(*how, "--libero-max-output=several", policy=f"{one},{other}")
    result.stdout.fnmatch_lines([f"Policy server {one} was left out: *. {other} answered instead."])
    pairs, _ = results("several")
    assert identities(pairs) == identities(alone)
    assert pairs[-1]["timings"]["server"] == other


def test_suites_have_servers_of_their_own(run: Run, results: Results, pytester: pytest.Pytester) -> None:
    manifest = tiny_manifest(events=("camera_shift",), suites=("libero_spatial", "libero_goal", "libero_10"))
    pytester.path.joinpath("suites.json").write_text(json.dumps(manifest))
    pytester.path.joinpath("blind.toml").write_text(BLIND["openpi"])
    asked: dict[str, int] = {"goal": 0, "other": 0}

    def counting(name: str) -> Callable[[Any], Any]:
        def handle(request: Any) -> Any:
            asked[name] += 1
            return reach(request)

        return handle

    with fakes.openpi(counting("goal")) as goal, fakes.openpi(counting("other")) as other:
        pytester.path.joinpath("map.toml").write_text(
            f'[[servers]]\nfor = ["libero_goal"]\naddress = "openpi://127.0.0.1:{goal}"\nrevision = "g"\n'
            f'[[servers]]\nfor = ["libero_spatial"]\naddress = "openpi://127.0.0.1:{other}"\nrevision = "s"\n'
        )
        result = run(
            "--libero-max-profile=blind.toml", "--libero-max-manifest=suites.json", policy="map.toml"
        )
    result.assert_outcomes(passed=4, skipped=2)
    pairs, report = results()
    assert min(asked.values()) > 0
    assert {pair["policy"]["revision"] for pair in pairs} == {"libero_goal: g; libero_spatial: s"}
    assert {pair["timings"]["server"] for pair in pairs} == {
        f"openpi://127.0.0.1:{goal}",
        f"openpi://127.0.0.1:{other}",
    }
    assert [group["for"] for group in report["provenance"]["policy"]["servers"]] == [
        ["libero_goal"],
        ["libero_spatial"],
    ]


def test_a_run_goes_on_at_another_address_of_the_declared_weights(
    run: Run, pytester: pytest.Pytester
) -> None:
    pytester.path.joinpath("blind.toml").write_text(BLIND["openpi"])
    how = ("--libero-max-profile=blind.toml", "--libero-max-revision=w")
    with fakes.openpi(reach) as first, fakes.openpi(reach) as second:
        one, other = (f"openpi://127.0.0.1:{port}" for port in (first, second))
        run(*how, "-k", "camera_shift", policy=one).assert_outcomes(passed=2)
        run(*how, "-k", "distractor_burst", "--libero-max-output=b", policy=other).assert_outcomes(passed=2)
        resume = ("-k", "camera_shift", "--libero-max-resume")
        assert run(*how, *resume, policy=other).ret == 0
        pytester.path.joinpath("map.toml").write_text(
            f'[[servers]]\nfor = ["camera_shift"]\naddress = "{other}"\n[[servers]]\naddress = "{one}"\n'
        )
        assert run(*how, *resume, policy="map.toml").ret == 0
        others = run(how[0], *resume, "--libero-max-revision=x", policy=other)
        assert others.ret == pytest.ExitCode.USAGE_ERROR
        run(how[0], "-k", "camera_shift", "--libero-max-output=c", policy=one).assert_outcomes(passed=2)
        refused = run(how[0], *resume, "--libero-max-output=c", policy=other)
    assert refused.ret == pytest.ExitCode.USAGE_ERROR
    refused.stdout.fnmatch_lines(["*policy.reference: *declare the weights: --libero-max-revision*"])
    merged = merge_folders(
        [pytester.path / "libero-max-results", pytester.path / "b"], pytester.path / "whole"
    )
    assert len(merged.records) == 4
    assert merged.run.provenance["policy"]["reference"] == ",".join(sorted((one, other)))
