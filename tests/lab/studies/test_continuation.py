"""Controllers that continue one prefix, played on the tiny world."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from pytest_libero_max.benchmark.latency import Latency
from pytest_libero_max.benchmark.programs import parse_program
from pytest_libero_max.errors import AdapterError, ManifestError, OptionError
from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, arms_of
from pytest_libero_max.lab.studies.continuation import Continue, Controller
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import Pair, PairSettings, measure_pair
from pytest_libero_max.policies.adapter_digest import require_separate_helpers
from pytest_libero_max.policies.loading import forget_adapter, load_policy
from pytest_libero_max.runs import plan
from pytest_libero_max.runs.agreement import Agreement
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.replay_command import Places, replay_of
from pytest_libero_max.studies.registry import study_from_dict
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.pairing.actors import BUDGET, Approaching, make_case
from tests.plugin.conftest import REACHER, results, run, short_sessions, tiny_manifest
from tests.report.made_up import PROVENANCE

__all__ = ["results", "run", "short_sessions"]  # fixtures

Run = Callable[..., pytest.RunResult]
Results = Callable[..., tuple[list[dict[str, Any]], dict[str, Any]]]

CASE = make_case(distance_m=0.25)


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def play(
    world: TinyWorld,
    study: Continue,
    controller: Approaching,
    prefix: Any = "fork",
    latency: Latency | None = None,
) -> Pair:
    first = Approaching(wait=3, horizon=8, interval=4)
    arms: tuple[Arm, ...] = (*arms_of(CASE), *study.arms(CASE, first.spec))
    if latency is not None:
        arms = tuple(replace(arm, latency=latency) for arm in arms)
    how = PairSettings(prefix, policies={"other": controller})
    return measure_pair(CASE, world, first, how, arms=arms)


@pytest.mark.parametrize("prefix", ["fork", "replay"])
def test_a_controller_is_asked_at_once_and_given_what_was_executed_and_queued(
    world: TinyWorld, prefix: Any
) -> None:
    controller = Approaching(horizon=6, interval=3)
    pair = play(world, Continue.of("other,own_base"), controller, prefix)
    arms, event = pair.record.arms, pair.record.arms[DYNAMIC].firings[0]
    assert list(arms) == [BASE, DYNAMIC, "dynamic_other", "base_other", "own_base_other"]
    assert (arms[DYNAMIC].stale_actions or 0) > 0
    for name in ("dynamic_other", "base_other"):
        assert arms[name].firings[0].prefix_proof == event.prefix_proof
        assert (arms[name].response_step, arms[name].stale_actions) == (event.step, 0)
        assert (arms[name].policy or {})["at_once"] is True
    given = [episode.handover for episode in controller.episodes]
    over = next(handover for handover in given if handover is not None)
    base = pair.rollouts[BASE]
    assert (over.policy, over.step) == ("approaching", event.step)
    assert np.array_equal(over.executed, base.actions[: event.step])
    stale = arms[DYNAMIC].stale_actions or 0
    assert np.array_equal(over.remaining, base.actions[event.step : event.step + stale])
    assert not over.executed.flags.writeable
    assert not over.remaining.flags.writeable
    assert None in given  # its own Base is an episode like any other
    assert arms["own_base_other"].queries == -(-arms["own_base_other"].steps // 3)
    assert PairRecord.from_dict(json.loads(json.dumps(pair.record.to_dict()))) == pair.record


def test_where_the_event_never_happens_no_controller_goes_on(world: TinyWorld) -> None:
    study, first = Continue.of("other,own_base"), Approaching(wait=BUDGET)
    case = make_case(distance_m=1e-6)
    how = PairSettings(policies={"other": Approaching(wait=BUDGET)})
    record = measure_pair(
        case, world, first, how, arms=(*arms_of(case), *study.arms(case, first.spec))
    ).record
    for name in ("dynamic_other", "base_other"):
        assert (record.arms[name].shares, record.arms[name].policy) == (BASE, None)
    assert record.arms["own_base_other"].policy is not None
    assert PairRecord.from_dict(json.loads(json.dumps(record.to_dict()))) == record
    fired = play(world, Continue.of("other,own_base"), Approaching(wait=BUDGET)).record
    planned = [PlannedPair.of(make_case(case_id=name, distance_m=1e-6)) for name in ("one", "two")]
    agreement = Agreement(plan.Run(tuple(planned), {**PROVENANCE, "policy": {}}))
    for pair, played in zip(planned, (record, structs.replace(record, arms=fired.arms)), strict=True):
        names = {"case_id": pair.case_id, "item_id": pair.item_id, "case_digest": pair.case_digest}
        agreement.add(structs.replace(played, **names), pair.case_id)


def test_base_and_dynamic_stay_those_of_a_run_without_the_study(world: TinyWorld) -> None:
    plain = measure_pair(CASE, world, Approaching(wait=3, horizon=8, interval=4)).record
    arms = play(world, Continue.of("other,4steps"), Approaching(horizon=6, interval=3)).record.arms
    assert {name: arms[name] for name in (BASE, DYNAMIC)} == dict(plain.arms)


@pytest.mark.parametrize("runner", ["async", "sync"])
@pytest.mark.parametrize("delay", [1, 3, 9])
def test_a_late_controller_acts_when_its_answer_is_there(world: TinyWorld, runner: Any, delay: int) -> None:
    pair = play(
        world, Continue.of("other"), Approaching(horizon=6, interval=3), latency=Latency(delay, runner)
    )
    rollout, record = pair.rollouts["dynamic_other"], pair.record.arms["dynamic_other"]
    event = record.firings[0]
    assert event.prefix_proof == pair.record.arms[DYNAMIC].firings[0].prefix_proof
    assert record.response_step == event.step
    assert record.stale_actions == min(delay, record.steps - event.step)
    waited = rollout.trajectory.executed[event.step : event.step + delay]
    if runner == "sync":
        assert all(step.held for step in waited)
    first = next(query for query in rollout.queries if query.step == event.step)
    step = event.step + delay
    if step < record.steps:
        dropped = 0 if runner == "sync" else delay - sum(step.held for step in waited)
        expected = first.actions[dropped] if dropped < len(first.actions) else None
        assert expected is None or np.array_equal(rollout.actions[step], expected)


def test_an_answer_that_is_under_way_at_the_handover_still_arrives(world: TinyWorld) -> None:
    """The answer that the first policy gives before the event is there earlier than the controller's."""
    case = make_case(distance_m=0.25)
    first = Approaching(wait=0, horizon=24, interval=6)
    study = Continue.of("other")
    arms = tuple(replace(arm, latency=Latency(5)) for arm in (*arms_of(case), *study.arms(case, first.spec)))
    how = PairSettings(policies={"other": Approaching(wait=BUDGET, horizon=12, interval=6)})
    pair = measure_pair(case, world, first, how, arms=arms)
    dynamic, other = pair.rollouts[DYNAMIC], pair.rollouts["dynamic_other"]
    event = pair.record.arms[DYNAMIC].firings[0].step
    assert np.array_equal(other.actions[: event + 5], dynamic.actions[: event + 5])
    assert not np.array_equal(other.actions[event + 5], dynamic.actions[event + 5])


def test_answers_that_come_late_from_the_event_on_are_arms_with_the_same_prefix(world: TinyWorld) -> None:
    arms = play(world, Continue.of("other,4steps"), Approaching(horizon=6, interval=3)).record.arms
    proofs = {arm.firings[0].prefix_proof for name, arm in arms.items() if name != BASE}
    assert len(proofs) == 1
    assert arms["dynamic_other_d4"].stale_actions == 4
    assert "dynamic_d4" in arms


def test_references_have_names_and_the_header_has_nothing_else() -> None:
    study = Continue.of("a/mine.py,other=b.py:make,c.py:Built,servers.toml,expert,own_base,4steps")
    assert study.controllers == (
        Controller("mine", "a/mine.py"),
        Controller("other", "b.py:make"),
        Controller("built", "c.py:Built"),
        Controller("servers", "servers.toml"),
        Controller("expert", None),
    )
    header = study.to_dict()
    assert header == {"name": "continue", "settings": "mine,other,built,servers,expert,own_base,4steps"}
    assert study_from_dict(header).to_dict() == header
    assert "b.py" not in json.dumps(header)


def test_a_replay_from_the_header_alone_names_no_code(tmp_path: Path) -> None:
    study = Continue.of("mine.py,expert")
    provenance = {**PROVENANCE, "protocol": {"study": study.to_dict()}}
    assert "--libero-max-study=continue:mine,expert" in replay_of(provenance, Places("servo"))
    placed = study.seen_from_elsewhere(tmp_path)
    assert placed == f"continue:mine={tmp_path}/mine.py,expert"
    assert f"--libero-max-study={placed}" in replay_of(provenance, Places("servo", study=placed))
    assert Continue.of(placed.partition(":")[2]).to_dict() == study.to_dict()
    assert Continue.of("expert,servo").seen_from_elsewhere(tmp_path) is None


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (None, "needs policies"),
        ("own_base", "needs policies"),
        ("a.py,b/a.py", "twice"),
        ("expert.py", "something else"),
        ("run", "something else"),
        ("Mine=a.py", "lower-case"),
    ],
)
def test_what_has_no_name_of_its_own_is_refused(settings: str | None, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        Continue.of(settings)


def test_only_another_policy_is_asked_at_once() -> None:
    arm_without = {"name": "a", "schedule": [{"trigger": "event", "change": "event"}], "at_once": True}
    with pytest.raises(ManifestError, match="at_once"):
        parse_program({"name": "mine", "arms": [arm_without]})
    (arm,) = Continue.of("expert").arms(CASE, Approaching().spec)[1:]
    assert arm.to_dict()["at_once"] is True


HELPED = """
from pytest_libero_max import PolicySpec
import {helper}

class Helped:
    spec = PolicySpec(name={helper}.NAME)
    def reset(self, episode): ...
    def predict(self, observation, query):
        import {lazy}
        return [[{lazy}.VALUE] * 7]

policy = Helped()
"""


def write_adapter(folder: Path, helper: str, lazy: str, value: float) -> str:
    folder.mkdir()
    (folder / "adapter.py").write_text(HELPED.format(helper=helper, lazy=lazy))
    (folder / f"{helper}.py").write_text(f"NAME = {folder.name!r}\n")
    (folder / f"{lazy}.py").write_text(f"VALUE = {value}\n")
    return str(folder / "adapter.py")


def test_two_adapters_in_one_process_keep_their_helpers(tmp_path: Path) -> None:
    first = write_adapter(tmp_path / "first", "of_first", "lazy_first", 0.25)
    second = write_adapter(tmp_path / "second", "of_second", "lazy_second", 0.5)
    require_separate_helpers([first, second, "expert", "tiny.module:policy"])
    try:
        one, other = load_policy(first), load_policy(second, further=True)
        assert (one.spec.name, other.spec.name) == ("first", "second")
        assert float(other.predict(None, None)[0][0]) == 0.5  # type: ignore[arg-type]
        assert float(one.predict(None, None)[0][0]) == 0.25  # type: ignore[arg-type]
    finally:
        forget_adapter()
    import sys

    assert not [path for path in sys.path if str(tmp_path) in path]
    assert "of_second" not in sys.modules


def test_two_helpers_of_one_name_are_refused(tmp_path: Path) -> None:
    first = write_adapter(tmp_path / "first", "helper", "lazy_first", 0.25)
    second = write_adapter(tmp_path / "second", "helper", "lazy_second", 0.5)
    with pytest.raises(AdapterError, match="helper 'helper' is in"):
        require_separate_helpers([first, second])
    require_separate_helpers([first, first])


def test_files_continue_in_a_session_and_are_played_again(
    run: Run, results: Results, pytester: pytest.Pytester
) -> None:
    (pytester.path / "other.py").write_text(REACHER)
    manifest = json.dumps(tiny_manifest(events=("camera_shift",)))
    pytester.path.joinpath("tiny.json").write_text(manifest)
    done = run(
        "--libero-max-study=continue:other.py,mine=other.py:policy",
        "--libero-max-verify=1",
        "--libero-max-gate=continue.other.over_mine == 0",
    )
    done.stdout.fnmatch_lines(["*Played again: 1 of 1 pair alike*"])
    records, _ = results()
    arm = records[0]["arms"]["dynamic_mine"]["policy"]
    assert (arm["reference"], arm["at_once"], len(arm["code"])) == ("other.py:policy", True, 64)
    header = json.loads((pytester.path / "libero-max-results" / "pairs.jsonl").read_text().splitlines()[0])
    assert header["provenance"]["protocol"]["study"] == {"name": "continue", "settings": "other,mine"}
    assert header["provenance"]["case_set"]["study"] == "continue:other=other.py,mine=other.py:policy"
    missing = run("--libero-max-study=continue:nowhere.py")
    assert missing.ret == pytest.ExitCode.USAGE_ERROR
    unknown = run("--libero-max-study=continue:nobody")
    assert unknown.ret == pytest.ExitCode.USAGE_ERROR
