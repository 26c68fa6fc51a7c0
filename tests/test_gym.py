"""Pairs that are played by other loops, through Gymnasium."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.cli import main
from pytest_libero_max.errors import OptionError, OtherRunError, ProtocolError
from pytest_libero_max.evaluation.stopping import Stop
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.policies.contract import Episode, Policy, Query, query_seed
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.report.page.case_table import run_cases
from pytest_libero_max.runs.lock import require_free
from pytest_libero_max.runs.replay_command import replay_command, replay_text
from pytest_libero_max.runs.store import read_pairs
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.worlds.contract import Observation

from .pairing.actors import Approaching, make_case
from .plugin.conftest import tiny_manifest
from .short_episodes import shorten_here

pytest.importorskip("gymnasium", reason="the extra gym")

from pytest_libero_max.gym import ArmOfRun, LiberoLoop, PairedRun

EVENTS = ("camera_shift", "target_relocation")
NEVER = make_case(distance_m=0.0001, init_state_index=4, case_id="never", record={"case_id": "never"})
CASES = Manifest("tiny", "1.0.0", {}, (*map(make_case, EVENTS), NEVER))


def chunks(policy: Policy, case: Case) -> Callable[[Observation, str], NDArray[np.float64]]:
    """A client as loops have it: a queue of Q actions, asked for an action at every step."""
    queue: deque[NDArray[np.float64]] = deque()
    asked: list[Query] = []
    step = 0

    def act(observation: Observation, instruction: str) -> NDArray[np.float64]:
        nonlocal step
        if not queue:
            query = Query(len(asked), step, instruction, query_seed(case.policy_seed, len(asked)))
            asked.append(query)
            queue.extend(policy.predict(observation, query)[: policy.spec.query_interval])
        step += 1
        return queue.popleft()

    policy.reset(Episode(case.suite, case.task_index, "", case.policy_seed, case.budget))
    return act


def play(env: ArmOfRun, policy: Policy) -> None:
    act, done = chunks(policy, env.case), False
    observation, info = env.reset(seed=1)
    while not done:
        assert env.observation_space.contains(dict(observation))
        observation, _, terminated, truncated, info = env.step(act(observation, info["instruction"]))
        done = terminated or truncated


def same(record: PairRecord, ours: PairRecord) -> None:
    assert record.arms == ours.arms
    assert (record.instruction, record.policy) == (ours.instruction, ours.policy)


def test_a_loop_of_ones_own_writes_the_records_of_the_runner(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    policy = Approaching(wait=2, horizon=5, interval=4)
    run = PairedRun(tmp_path, policy.spec, CASES, substrate="tiny")
    with pytest.raises(ProtocolError, match="Play Base first"):
        run.env(run.cases[0], DYNAMIC).reset()
    with pytest.raises(ProtocolError, match=r"'dynamik'\. .*'dynamic'"):
        run.env(run.cases[0], "dynamik")
    for arm in (BASE, DYNAMIC):
        for case in run.cases:
            play(run.env(case, arm), policy)
    substrate = open_substrate("tiny")
    records = read_pairs(tmp_path).records
    assert [record.trigger_step is not None for record in records].count(True) == len(EVENTS)
    for case, record in zip(run.cases, records, strict=True):
        same(record, play_pair(case, substrate.world(case), policy))
    substrate.close()
    assert main(["report", str(tmp_path)]) == 0
    assert (tmp_path / "report.html").exists()
    assert not PairedRun(tmp_path, policy.spec, CASES, substrate="tiny").cases
    capsys.readouterr()


def test_a_run_is_resumed_with_its_own_policy_alone_and_a_refusal_leaves_the_folder_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    policy = Approaching(wait=2, horizon=5, interval=4)
    run = PairedRun(tmp_path, policy.spec, CASES, substrate="tiny")
    for arm in (BASE, DYNAMIC):
        play(run.env(run.cases[0], arm), policy)
    run.close()
    other = replace(policy.spec, query_interval=2)
    with pytest.raises(OptionError, match=r"policy\.query_interval: 4, 2.*another output"):
        PairedRun(tmp_path, other, CASES, substrate="tiny")
    require_free(tmp_path)
    before = (tmp_path / "pairs.jsonl").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(Stop, "begin", _broken)
        with pytest.raises(OSError, match="broken"):
            PairedRun(tmp_path, policy.spec, CASES, substrate="tiny")
    require_free(tmp_path)
    assert (tmp_path / "pairs.jsonl").read_bytes() == before
    again = PairedRun(tmp_path, policy.spec, CASES, substrate="tiny")
    again.policy = other  # found by nothing but the record
    play(again.env(again.cases[0]), policy)
    with pytest.raises(OtherRunError):
        play(again.env(again.cases[0], DYNAMIC), policy)
    require_free(tmp_path)


def _broken(*_: object) -> None:
    raise OSError("broken")


def test_a_case_is_selected_by_either_of_its_ids(tmp_path: Path) -> None:
    policy = Approaching().spec
    wanted = CASES.cases[1]
    for number, name in enumerate((wanted.case_id, wanted.item_id)):
        run = PairedRun(tmp_path / str(number), policy, CASES, substrate="tiny", only=[name])
        assert run.cases == (wanted,)
        run.close()
        stored = read_pairs(tmp_path / str(number)).run
        assert [pair.case_id for pair in stored.planned] == [wanted.case_id]
        assert stored.provenance["selection"]["asked"] == [f"only={name}"]
    with pytest.raises(OptionError, match=r"camera_shif. is not in"):
        PairedRun(tmp_path / "wrong", policy, CASES, substrate="tiny", only=["case-camera_shif"])


def test_a_run_of_another_loop_is_filmed_from_its_traces_and_says_where_its_pairs_are_played_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    policy = load_policy("random")
    policy.spec = type(policy.spec)("mine", cameras=("agentview",))
    shorten_here(monkeypatch, 12)
    with pytest.raises(OptionError, match=r"traces='every'.*regressions, changed"):
        PairedRun(tmp_path, policy.spec, "smoke", traces="every")
    manifest = tmp_path / "tiny.json"
    manifest.write_text(json.dumps(tiny_manifest(events=("camera_shift",))))
    for name in ("none", "all"):
        run = PairedRun(tmp_path / name, policy.spec, str(manifest), 1, "tiny", traces=name)
        for arm in run.arms(run.cases[0]):
            play(run.env(run.cases[0], arm), policy)
    capsys.readouterr()
    assert main(["film", str(tmp_path / "none"), "--select=all", f"--cases={manifest}"]) == 1
    assert 'with PairedRun(..., traces="all").' in capsys.readouterr().err
    assert main(["film", str(tmp_path / "all"), "--select=all", "--size=64", f"--cases={manifest}"]) == 0
    assert len(list((tmp_path / "all" / "films").iterdir())) == 1
    assert main(["report", str(tmp_path / "all")]) == 0
    capsys.readouterr()
    again = "in the program of that run, in another folder: no command here can load its policy."
    for name, line in (("all", "see: libero-max view"), ("none", f"again: {again}")):
        main(["gate", str(tmp_path / name), "--gate=dynamic_sr >= 50%"])
        assert line in capsys.readouterr().out
    stored = read_pairs(tmp_path / "all")
    offered = [each["caption"] for each in run_cases(stored, {}, {}, tmp_path / "all")["commands"]]
    assert offered[:2] == [f"Play it {again}", f"Play it again {again}"]
    assert not any("again and film" in caption for caption in offered)
    assert replay_text(replay_command(stored)) == again
    assert "--libero-max-policy" not in (tmp_path / "all" / "report.html").read_text()


def test_answers_in_the_prefix_are_compared_and_not_executed(tmp_path: Path) -> None:
    case = CASES.cases[0]
    for repeatable in (True, False):
        policy = Approaching(wait=2)
        object.__setattr__(policy.spec, "repeatable", repeatable)
        run = PairedRun(
            tmp_path / str(repeatable), policy.spec, Manifest("t", "1", {}, (case,)), None, "tiny"
        )
        play(run.env(case, BASE), policy)
        policy.wait = 3
        dynamic = run.env(case, DYNAMIC)
        play(dynamic, policy)
        assert dynamic.differing == (2,)
        stored = read_pairs(tmp_path / str(repeatable))
        assert len(stored.records) == (not repeatable)
        assert ["prefix, at step 2" in each.message for each in stored.errors] == ([True] * repeatable)


def test_the_places_of_a_batch_keep_the_scene_that_they_play_and_no_other(tmp_path: Path) -> None:
    run = PairedRun(tmp_path, Approaching(wait=2).spec, CASES, substrate="tiny")
    for case in run.cases:
        run.vector([case, case]).reset()
    first, second = (run._substrates[place] for place in (0, 1))
    run.vector(run.cases[:2]).reset()
    assert run._substrates[0] is not first
    assert run._substrates[1] is not second
    run.close()


def test_a_vector_of_cases_and_two_environments_in_one_world(tmp_path: Path) -> None:
    policy = Approaching(wait=2)
    run = PairedRun(tmp_path, policy.spec, CASES, substrate="tiny")
    for arm in (BASE, DYNAMIC):
        vector, done = run.vector(run.cases, arm), np.zeros(len(run.cases), dtype=bool)
        acts = [chunks(policy, case) for case in run.cases]
        observations, _ = vector.reset()
        while not done.all():
            each = [{name: values[i] for name, values in observations.items()} for i in range(len(done))]
            actions = np.array([act(seen, "") for act, seen in zip(acts, each, strict=True)])
            observations, _, terminated, truncated, info = vector.step(actions)
            done |= terminated | truncated
        assert list(info["arm"]) == [arm] * len(done)
        for _ in range(2 * CASES.cases[0].budget):
            ended, _, _, _, info = vector.step(np.zeros((len(done), 7)))
        assert all((ended[name] == values).all() for name, values in observations.items())
    substrate = open_substrate("tiny")
    for case, record in zip(run.cases, read_pairs(tmp_path).records, strict=True):
        same(record, play_pair(case, substrate.world(case), policy))
    run = PairedRun(tmp_path / "interleaved", policy.spec, CASES, substrate="tiny")
    one, other = (run.env(case) for case in CASES.cases[:2])
    one.reset()
    other.reset()
    with pytest.raises(ProtocolError, match="another environment has"):
        one.step(np.zeros(7))
    run.close()


def libero_loop(env: LiberoLoop, policy: Policy, case: Case, budget: int) -> bool:
    """Play an episode as evaluation code for LIBERO does: reset, initial state, ten waiting steps.

    Returns:
        What such code takes for success.
    """
    act = chunks(policy, case)
    env.seed(7)
    env.reset()
    observation, done = env.set_init_state(None), False
    for step in range(budget + 10):
        if step < 10:
            observation, _, done, _ = env.step([0.0] * 6 + [-1.0])
            continue
        action = act(observation, "")
        observation, _, done, _ = env.step(action.tolist())
        if done:
            break
    return done


def test_a_loop_written_for_libero_plays_a_pair_on_a_robot(tmp_path: Path) -> None:
    policy = load_policy("random")
    policy.spec = type(policy.spec)("random", cameras=())
    run = PairedRun(tmp_path, policy.spec, load_track("smoke"), limit=1)
    (case,) = run.cases
    for arm, more in zip(run.arms(case), (0, 5), strict=True):
        assert not libero_loop(LiberoLoop(run.env(case, arm)), policy, case, case.budget + more)
    substrate = open_substrate("embedded")
    (record,) = read_pairs(tmp_path).records
    same(record, play_pair(case, substrate.world(case), policy))
    substrate.close()
