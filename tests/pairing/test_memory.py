"""How the memory of a policy crosses the event: as a copy, or shown again. All ways are equal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError, RefusalError, ServerError
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.check import check_policy, memory_of
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from pytest_libero_max.policies.wrapping import WrappedPolicy
from pytest_libero_max.substrates.tiny.world import TinyWorld

from .actors import make_case

CASE = make_case("target_relocation", distance_m=0.3)


class Frames:
    """Moves towards a place by the mean of the last seven positions that it saw, one a step."""

    def __init__(self) -> None:
        self.spec = PolicySpec("frames", 4, 2, cameras=())
        self.seen: list[tuple[int, Any]] = []

    def reset(self, episode: Any) -> None:
        self.seen = []

    def see(self, observation: Any, step: int) -> None:
        self.seen.append((step, observation["robot0_eef_pos"]))

    def predict(self, observation: Any, query: Any) -> Any:
        steps = [step for step, _ in self.seen]
        assert steps == list(range(query.step + 1))
        mean = np.mean([position for _, position in self.seen[-7:]], axis=0)
        action = np.zeros(7)
        action[:3] = np.clip((np.array([0.1, -0.1, 0.5]) - mean) / 0.1, -1, 1)
        return np.tile(action, (4, 1))


class CopiedFrames(Frames):
    def snapshot(self) -> Any:
        return list(self.seen)

    def restore(self, memory: Any) -> None:
        self.seen = list(memory)


class Queries:
    """The same by the positions that it was asked at."""

    def __init__(self, history: bool = True) -> None:
        self.spec = PolicySpec("queries", 4, 2, cameras=(), history=history)
        self.seen: list[Any] = []

    def reset(self, episode: Any) -> None:
        self.seen = []

    def predict(self, observation: Any, query: Any) -> Any:
        self.seen.append(observation["robot0_eef_pos"])
        assert len(self.seen) == query.index + 1
        action = np.zeros(7)
        action[:3] = np.clip((np.array([0.1, -0.1, 0.5]) - np.mean(self.seen[-3:], axis=0)) / 0.1, -1, 1)
        return np.tile(action, (4, 1))


class CopiedQueries(Queries):
    def __init__(self) -> None:
        super().__init__(history=False)

    def snapshot(self) -> Any:
        return list(self.seen)

    def restore(self, memory: Any) -> None:
        self.seen = list(memory)


@pytest.fixture
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def played(world: TinyWorld, policy: Any, mode: Any = "fork") -> PairRecord:
    record = measure_pair(CASE, world, check_policy(policy, "policy"), PairSettings(mode)).record
    assert record.triggered
    assert record.dynamic_queries > 3
    return record


@pytest.mark.parametrize(
    ("copied", "shown", "kind"), [(CopiedFrames, Frames, "frames"), (CopiedQueries, Queries, "queries")]
)
def test_a_memory_that_is_shown_again_is_the_one_that_is_copied(
    copied: Any, shown: Any, kind: str, world: TinyWorld
) -> None:
    records = [played(world, policy(), mode) for policy in (copied, shown) for mode in ("fork", "replay")]
    assert [record.policy["memory"] for record in records] == ["snapshot"] * 2 + [kind] * 2
    assert len({str(record.identity()["arms"]) for record in records}) == 1


def test_every_step_is_shown_once_with_its_images(world: TinyWorld) -> None:
    class Looking(Frames):
        def see(self, observation: Any, step: int) -> None:
            assert observation["agentview_image"].shape == (8, 8, 3)
            super().see(observation, step)

    policy = Looking()
    policy.spec = PolicySpec("looking", 4, 2, cameras=("agentview",), image_size=8)
    rollout = Rollout.start(Stage(CASE, world, policy))
    for _ in range(5):
        rollout.advance()
    assert [step for step, _ in policy.seen] == list(range(5))


def test_a_memory_that_is_not_declared_is_found(world: TinyWorld) -> None:
    class Undeclared(Queries):
        def __init__(self) -> None:
            super().__init__(history=False)

        def predict(self, observation: Any, query: Any) -> Any:
            return super().predict(observation, type(query)(len(self.seen), query.step, "", 0))

    with pytest.raises(RefusalError, match=r"answered query .* differently"):
        played(world, Undeclared())


def test_a_policy_that_sees_every_step_is_the_same_behind_a_server(world: TinyWorld) -> None:
    own = played(world, CopiedFrames())
    with serving(Host(CopiedFrames(), "x"), port=0) as (port, _):
        served = load_served(f"openpi://127.0.0.1:{port}?patience=0.2", "served")
        records = [played(world, served, mode) for mode in ("fork", "replay")]
        served.client.close()
        with pytest.raises(ServerError, match=r"\(see\)"):
            load_served(f"vla-eval://127.0.0.1:{port}/vla-eval?patience=0.2", "vla_eval", 4, 2)
    assert len({str(record.identity()["arms"]) for record in (own, *records)}) == 1
    assert {record.policy["memory"] for record in records} == {"snapshot"}


def test_a_policy_without_a_memory_has_none_in_its_record(world: TinyWorld) -> None:
    class Forgetful(Queries):
        def __init__(self) -> None:
            super().__init__(history=False)

        def predict(self, observation: Any, query: Any) -> Any:
            self.seen = [observation["robot0_eef_pos"]]
            return super().predict(observation, type(query)(1, query.step, "", 0))

    policy = Forgetful()
    assert memory_of(policy) == "none"
    assert "memory" not in played(world, policy).policy


def test_a_server_and_a_wrapper_refuse_what_they_cannot_show() -> None:
    for policy, message in (
        (Frames(), "cannot copy it"),
        (Queries(), "cannot copy it"),
    ):
        with pytest.raises(AdapterError, match=message):
            Host(policy, "x")
    with pytest.raises(AdapterError, match=r"\(see\), .*wrapper"):
        WrappedPolicy(Frames(), "restore=gated")


def test_the_declaration_is_checked() -> None:
    with pytest.raises(AdapterError, match="history='yes'"):
        PolicySpec("x", history="yes")  # type: ignore[arg-type]
    assert PolicySpec("x", history=True).to_dict()["history"] is True
    assert "history" not in PolicySpec("x").to_dict()
    policy: Any = Frames()
    policy.see = lambda observation: None
    with pytest.raises(AdapterError, match=r"see\(observation, step\)"):
        check_policy(policy, "policy")
