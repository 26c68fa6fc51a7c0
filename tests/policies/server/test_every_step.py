"""A policy that needs every frame, as wide images, behind a server: the profile of Mimic-Video in a pair."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from pytest_libero_max.policies.transforms.images import rotate_180
from tests.films.short_run import leave_out_shadows
from tests.pairing.actors import Approaching, Solvable, make_case
from tests.policies.clients import fakes


class Video:
    """Keeps the last 17 frames and looks at every fourth, as Mimic-Video does; moves towards the box.

    Its answer depends on all that it was shown: the sum of the frames decides about the second action.
    """

    def __init__(self) -> None:
        self.spec = PolicySpec("video", 16, 5)
        self.asked: list[tuple[int, str, Any]] = []
        self.looked: list[Any] = []
        self._frames: deque[Any] = deque(maxlen=17)

    def reset(self, episode: Any) -> None:
        self._frames = deque(maxlen=17)

    def see(self, observation: Any, step: int) -> None:
        self._frames.extend([observation["image"]] * (1 if self._frames else 17))

    def predict(self, observation: Any, query: Any) -> Any:
        shown = np.stack([self._frames[at] for at in range(0, 17, 4)])
        self.asked.append((query.step, query.instruction, observation["state"]))
        self.looked.append(shown)
        actions = np.zeros((16, 7))
        actions[:, 2] = -0.3
        actions[1:, 0] = (int(shown.sum(dtype=np.int64)) % 101) / 101
        return actions

    def snapshot(self) -> Any:
        return tuple(self._frames)

    def restore(self, memory: Any) -> None:
        self._frames = deque(memory, maxlen=17)


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[Solvable]:
    leave_out_shadows(monkeypatch)
    world = Solvable()
    yield world
    world.close()


def test_mimic_video_is_shown_every_frame_of_both_arms_as_it_was_trained(world: Solvable) -> None:
    video = Video()
    instruction = "pick up the black bowl"
    case = replace(make_case("target_relocation", distance_m=0.5), instruction=instruction)
    with serving(Host(video, "x"), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}", "mimic_video")
        record = play_pair(case, world, policy)
        policy.client.close()
    assert record.to_dict()["policy"]["image_size"] == [480, 640]
    assert record.trigger_step is not None
    assert 0 < record.trigger_step < 20
    steps = [step for step, _, _ in video.asked]
    base = list(range(0, 25, 5))
    assert steps[:5] == base
    assert set(steps[5:]) <= set(base)
    for (step, words, state), looked in zip(video.asked, video.looked, strict=True):
        assert looked.shape == (5, 480, 640, 3)
        assert words == instruction.replace("black ", "")
        assert (state.shape, state.dtype) == ((10,), np.float32)
        if step == 0:
            assert (looked == looked[-1]).all(), "before the first frame there are copies of it"
    # The first query after the event still looks at frames from before it, and at some from after it.
    looked = dict(zip(steps[:5], video.looked[:5], strict=True))
    later = dict(zip(steps[5:], video.looked[5:], strict=True))
    first = min(step for step in later if step > record.trigger_step)
    before = sum(step < record.trigger_step for step in range(first - 16, first + 1, 4))
    assert 0 < before < 5
    assert np.array_equal(later[first][:before], looked[first][:before])
    assert not np.array_equal(later[first][-1], looked[first][-1])


def test_what_it_is_shown_is_what_the_world_draws_turned(world: Solvable) -> None:
    video = Video()
    with serving(Host(video, "x"), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}", "mimic_video")
        world.reset(3)
        policy.reset(fakes.EPISODE)
        drawn = []
        for step in range(21):
            observation = world.observe(policy.spec.cameras, policy.spec.image_size)
            drawn.append(rotate_180(observation["agentview_image"]))
            policy.see(observation, step)  # type: ignore[attr-defined]
            if step % 5 == 0:
                policy.predict(observation, replace(fakes.query(step // 5), step=step))
            world.step((0.5, 0.5, 0, 0, 0, 0, -1))
        policy.client.close()
    assert policy.spec.cameras == ("agentview",)
    assert np.array_equal(video.looked[-1], np.stack(drawn)[4::4])
    (*_, (_, _, state)) = video.asked
    matrix_rows, finger = state[3:9].reshape(2, 3), state[9]
    assert np.allclose(matrix_rows @ matrix_rows.T, np.eye(2), atol=1e-5)
    assert finger == np.float32(observation["robot0_gripper_qpos"][0])


def test_a_server_that_is_not_shown_every_step_is_refused() -> None:
    refused = pytest.raises(AdapterError, match=r"'mimic_video' .* every step")
    with serving(Host(Approaching(), "x"), port=0) as (port, _), refused:
        load_served(f"openpi://127.0.0.1:{port}", "mimic_video")
    with fakes.openpi(lambda request: {}) as port, pytest.raises(AdapterError, match="sees every step"):
        load_served(f"openpi://127.0.0.1:{port}", "mimic_video")
