"""The adaptive wrapper: whole chunks, early queries where something changed, never more than the budget."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.lab.wrappers.adaptive import SURPRISE, AdaptivePolicy, block_changes, surprise
from pytest_libero_max.lab.wrappers.restoration import RestoringPolicy
from pytest_libero_max.pairing.prefix import PrefixMode
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import PairSettings, play_pair
from pytest_libero_max.policies.contract import Episode, Query, query_seed
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Observation
from tests.pairing.actors import Approaching, make_case

H, Q = 10, 5
EPISODE = Episode("libero_spatial", 0, "", 195, 50)


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


class Counting(Approaching):
    """Returns chunks that tell which query they answer, and from which of its steps each action is."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        super().predict(observation, query)
        actions = np.zeros((H, 7))
        actions[:, 0], actions[:, 1] = query.index / 100, np.arange(H) / 100
        return actions


def play(shown: list[NDArray[np.uint8]]) -> tuple[Counting, list[tuple[int, int]]]:
    """What is executed at each step, as (query, action), when these images are seen."""
    inner = Counting(horizon=H, interval=Q, cameras=("agentview",))
    policy = AdaptivePolicy(inner, "image")
    policy.reset(EPISODE)
    done = []
    for step, image in enumerate(shown):
        (action,) = policy.predict({"agentview_image": image}, Query(step, step, "", 7))
        done.append((round(100 * action[0]), round(100 * action[1])))
    return inner, done


def still(count: int) -> list[NDArray[np.uint8]]:
    return [np.full((64, 64, 3), 90, np.uint8)] * count


def flash(images: list[NDArray[np.uint8]], step: int) -> list[NDArray[np.uint8]]:
    """The same images with a square that appears at a step and stays."""
    changed = images[0].copy()
    changed[16:32, 16:32] = 200
    return [*images[:step], *[changed] * (len(images) - step)]


def test_without_a_change_whole_chunks_are_executed() -> None:
    inner, done = play(still(25))
    assert done == [(step // H, step % H) for step in range(25)]
    assert [(query.index, query.step) for query in inner.queries] == [(0, 0), (1, 10), (2, 20)]
    assert [query.seed for query in inner.queries] == [query_seed(195, index) for index in range(3)]


def test_a_sudden_change_is_answered_at_once() -> None:
    inner, done = play(flash(still(25), 7))
    assert [query.step for query in inner.queries] == [0, 7, 17]
    assert done[6:9] == [(0, 6), (1, 0), (1, 1)]


def test_early_queries_stay_within_the_budget() -> None:
    (dark,) = still(1)
    (bright,) = flash(still(1), 0)
    inner, _ = play([bright if step // 3 % 2 else dark for step in range(60)])  # a change every third step
    steps = [query.step for query in inner.queries]
    assert all(number + 1 <= 1 + step // Q for number, step in enumerate(steps))
    assert len(steps) > 60 // H  # it was asked early at all


def test_steady_movement_is_no_surprise_and_a_jump_is_one() -> None:
    def square(left: int) -> NDArray[np.uint8]:
        image = np.full((256, 256, 3), 60, np.uint8)
        image[100:160, left : left + 40] = 220
        return image

    steady = [block_changes(square(left), square(left + 4)) for left in (20, 24)]
    jump = block_changes(square(24), square(120))
    assert surprise(*steady) < SURPRISE < surprise(steady[0], jump)


def test_all_of_a_wide_image_is_watched() -> None:
    before = np.zeros((48, 96, 3), np.uint8)
    now = before.copy()
    now[:, 90:] = 200
    changes = block_changes(before, now)
    assert changes.shape == (16, 16)
    assert (changes[:, 15] == 200).all()
    assert not changes[:, :15].any()


def test_privileged_watches_objects_that_are_not_held(world: TinyWorld) -> None:
    case = make_case("target_relocation")
    fixed = Approaching(horizon=20, interval=20, privileged=True)
    watching = AdaptivePolicy(Approaching(horizon=20, interval=2, privileged=True), "privileged")
    plain, adaptive = (play_pair(case, world, policy) for policy in (fixed, watching))
    assert plain.trigger_step == adaptive.trigger_step
    assert adaptive.trigger_step is not None
    assert adaptive.stale_actions == 0
    assert plain.stale_actions is not None
    assert plain.stale_actions > 0
    notes = adaptive.arms["dynamic"].notes
    assert notes is not None
    assert notes["early"] == 1
    base = adaptive.arms["base"].notes
    assert base is not None
    assert (base["early"], base["looks"]) == (0, adaptive.base_steps)
    assert PairRecord.from_dict(adaptive.to_dict()) == adaptive


def test_fork_and_replay_give_the_same_record(world: TinyWorld) -> None:
    case = make_case("target_relocation")
    records = []
    modes: tuple[PrefixMode, ...] = ("fork", "replay")
    for prefix in modes:
        policy = AdaptivePolicy(Approaching(horizon=8, interval=2, privileged=True), "privileged")
        records.append(play_pair(case, world, policy, PairSettings(prefix=prefix)).identity())
    assert records[0] == records[1]


def test_a_snapshot_holds_chunk_budget_and_what_was_seen() -> None:
    policy = AdaptivePolicy(Counting(horizon=H, interval=Q, cameras=("agentview",)), "image")
    images = flash(still(25), 7)
    policy.reset(EPISODE)

    def answers(first: int, last: int) -> list[bytes]:
        steps = range(first, last)
        return [policy.predict({"agentview_image": images[n]}, Query(n, n, "", 7)).tobytes() for n in steps]

    answers(0, 6)
    memory = policy.snapshot()
    rest = answers(6, 25)
    policy.restore(memory)
    assert answers(6, 25) == rest


def test_what_a_wrapper_inside_counts_is_kept() -> None:
    policy = AdaptivePolicy(RestoringPolicy(Counting(horizon=H, interval=Q, cameras=("agentview",))), "image")
    policy.reset(EPISODE)
    observation = {"agentview_image": still(1)[0]}
    policy.predict(observation, Query(0, 0, "", 7))
    assert policy.query_notes["asked"] == policy.query_notes["images"] == 1
    policy.predict(observation, Query(1, 1, "", 7))
    assert policy.query_notes == {"looks": 1, "asked": 0, "early": 0}
    assert policy.spec.wrappers == ("restore=gated", f"adaptive=image H={H} Q={Q}")
    assert (policy.spec.horizon, policy.spec.query_interval) == (1, 1)


def test_what_cannot_be_watched_is_refused() -> None:
    with pytest.raises(AdapterError, match="fixed camera"):
        AdaptivePolicy(Approaching(cameras=("robot0_eye_in_hand",)), "image")
    with pytest.raises(AdapterError, match="is not privileged"):
        AdaptivePolicy(Approaching(cameras=("agentview",)), "privileged")
    with pytest.raises(AdapterError, match="mode='both'"):
        AdaptivePolicy(Approaching(cameras=("agentview",)), "both")  # type: ignore[arg-type]
