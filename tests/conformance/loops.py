"""Evaluation loops: sound ones, as the pages and other packages have them, and some with one mistake each.

Each plays one episode of an environment with a policy, and returns its success.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np


def plain(env: Any, policy: Any) -> bool:
    """The loop of the page on loops."""
    done = success = False
    policy.reset()
    observation, info = env.reset()
    while not done:
        action = policy.act(observation, info["instruction"])
        observation, _, success, truncated, info = env.step(action)
        done = success or truncated
    return success


class Client:
    """openpi's client, with the policy in place of a server."""

    def __init__(self, policy: Any) -> None:
        self._policy = policy

    def infer(self, element: Mapping[str, Any]) -> Mapping[str, Any]:
        return {"actions": self._policy.predict(element, element["prompt"])}


def openpi(spied: Any, policy: Any) -> bool:
    """The episode of openpi's LIBERO client, with LiberoLoop in place of LIBERO's environment."""
    from pytest_libero_max.gym import LiberoLoop

    client, waits, replan_steps = Client(policy), 10, policy.query_interval
    env = LiberoLoop(spied, waiting_steps=waits)
    env.reset()
    policy.reset()
    plan: deque[Any] = deque()
    observation, max_steps, done, t = env.set_init_state(None), spied.max_steps, False, 0
    while t < max_steps + waits:
        if t < waits:
            observation, _, done, _ = env.step([0.0] * 6 + [-1.0])
            t += 1
            continue
        image = np.ascontiguousarray(observation["agentview_image"][::-1, ::-1])
        wrist = np.ascontiguousarray(observation["robot0_eye_in_hand_image"][::-1, ::-1])
        if not plan:
            element = {
                "observation/image": image,
                "observation/wrist_image": wrist,
                "observation/state": np.concatenate(
                    (observation["robot0_eef_pos"], np.zeros(3), observation["robot0_gripper_qpos"])
                ),
                "prompt": str(env.task_description),
            }
            plan.extend(client.infer(element)["actions"][:replan_steps])
        observation, _, done, _ = env.step(plan.popleft().tolist())
        if done:
            break
        t += 1
    return done


def chunks(env: Any, policy: Any) -> Mapping[str, bool]:
    """A loop that executes a chunk at a time, as RLinf's does, with images as numbers from 0 to 1."""
    policy.reset()
    observation, info = env.reset()
    while True:
        images = np.stack([observation["agentview_image"], observation["robot0_eye_in_hand_image"]])
        shown = {
            "images": images.transpose(0, 3, 1, 2) / np.float32(255),
            "states": observation["robot0_eef_pos"],
        }
        for action in policy.predict(shown, info["instruction"])[: policy.query_interval]:
            observation, _, terminated, truncated, info = env.step(action.astype(np.float32))
            if terminated or truncated:
                return {"success": info["is_success"]}


class Vector:
    """A vector environment of one, which begins the next episode by itself, as Gymnasium's do."""

    def __init__(self, env: Any) -> None:
        self._env, self._over = env, False

    def reset(self, seed: int) -> Any:
        return self._env.reset(seed=seed)

    def step(self, action: Any) -> Any:
        observation, reward, terminated, truncated, info = self._env.step(action)
        if terminated or truncated:
            last = info
            observation, info = self._env.reset()
            info = {**info, "final_info": last}
        return observation, reward, terminated, truncated, info


def vector(env: Any, policy: Any) -> bool:
    """A loop over a vector environment, as LeRobot's: success is in the final info."""
    wrapped = Vector(env)
    policy.reset()
    observation, _ = wrapped.reset(seed=1000)
    for _ in range(env.max_steps):
        action = policy.act(observation, env.task_description)
        observation, _, terminated, truncated, info = wrapped.step(action)
        if terminated or truncated:
            return bool(info["final_info"]["is_success"])
    return False


def vla_eval(spied: Any, policy: Any) -> Mapping[str, Any]:
    """An episode by vla-eval's own runner, with the policy in place of a server."""
    from vla_eval.benchmarks.base import StepBenchmark, StepResult
    from vla_eval.runners.sync_runner import SyncEpisodeRunner

    class Benchmark(StepBenchmark):  # type: ignore[misc]  # untyped where vla-eval is not installed
        def get_tasks(self) -> list[dict[str, Any]]:
            return [{"name": "task"}]

        def reset(self, task: Any) -> Any:
            return spied.reset()[0]

        def step(self, action: Any) -> Any:
            observation, reward, terminated, truncated, info = spied.step(action["actions"])
            return StepResult(observation, reward, terminated or truncated, info)

        def make_obs(self, raw_obs: Any, task: Any) -> dict[str, Any]:
            images = {"agentview": raw_obs["agentview_image"], "wrist": raw_obs["robot0_eye_in_hand_image"]}
            words = spied.task_description
            return {"images": images, "states": raw_obs["robot0_eef_pos"], "task_description": words}

        def get_step_result(self, step_result: Any) -> dict[str, Any]:
            return {"success": step_result.info["is_success"]}

    class Connection:
        async def start_episode(self, payload: Any) -> None:
            policy.reset()

        async def act(self, observation: Any) -> dict[str, Any]:
            return {"actions": policy.act(observation, observation["task_description"])}

        async def end_episode(self, result: Any) -> None:
            pass

    async def play() -> Mapping[str, Any]:
        result = await SyncEpisodeRunner().run_episode(Benchmark(), {"name": "task"}, Connection())
        metrics: Mapping[str, Any] = result["metrics"]
        return metrics

    return asyncio.run(play())


SOUND = (plain, openpi, chunks, vector, vla_eval)


# One mistake each.


class Loop:
    """A loop by chunks, whose parts others replace."""

    seed: int | None = None

    def __init__(self) -> None:
        self.played = 0

    def __call__(self, env: Any, policy: Any) -> Any:
        self.played += 1
        self.begin(policy)
        observation, info = self.reset(env)
        ended = False
        while not ended:
            actions = policy.predict(self.shown(observation), self.instruction(info))
            for action in self.chosen(actions, policy.query_interval):
                observation, _, terminated, truncated, info = env.step(action)
                if ended := terminated or truncated:
                    break
        return self.result(env, info)

    def begin(self, policy: Any) -> None:
        policy.reset()

    def reset(self, env: Any) -> Any:
        return env.reset(seed=self.seed)

    def shown(self, observation: Any) -> Any:
        return observation

    def instruction(self, info: Any) -> str:
        return str(info["instruction"])

    def chosen(self, actions: Any, query_interval: int) -> Any:
        return actions[:query_interval]

    def result(self, env: Any, info: Any) -> Any:
        return info["is_success"]


class Raising(Loop):
    def shown(self, observation: Any) -> Any:
        return {"image": observation["agentview_rgb"]}


class Silent(Loop):
    """Returns nothing."""

    def result(self, env: Any, info: Any) -> Any:
        return None


class Late(Loop):
    """Shows the image of the query before."""

    last: Any = None

    def reset(self, env: Any) -> Any:
        self.last = None
        return super().reset(env)

    def shown(self, observation: Any) -> Any:
        last, self.last = self.last, observation
        images = {key: value for key, value in (last or observation).items() if key.endswith("_image")}
        return {**observation, **images}


class OldState(Loop):
    """Shows the state of the beginning."""

    first: Any = None

    def reset(self, env: Any) -> Any:
        observation, info = super().reset(env)
        self.first = observation["robot0_eef_pos"]
        return observation, info

    def shown(self, observation: Any) -> Any:
        return {**observation, "robot0_eef_pos": self.first}


class OneBuffer(Loop):
    """Shows every image in the same array."""

    buffer = np.zeros((64, 64, 3), np.uint8)

    def shown(self, observation: Any) -> Any:
        self.buffer[:] = observation["agentview_image"]
        return {**observation, "agentview_image": self.buffer}


class OldInstruction(Loop):
    words = ""

    def reset(self, env: Any) -> Any:
        self.words = env.task_description
        return super().reset(env)

    def instruction(self, info: Any) -> str:
        return self.words


class Waiting(Loop):
    """Waits for the world to settle, which it has."""

    def reset(self, env: Any) -> Any:
        observation, info = super().reset(env)
        for _ in range(3):
            observation, *_, info = env.step([0.0] * 6 + [-1.0])
        return observation, info


class LeftOver(Loop):
    """Keeps a queue over the end of an episode."""

    def __init__(self) -> None:
        super().__init__()
        self.queue: deque[Any] = deque()

    def __call__(self, env: Any, policy: Any) -> Any:
        policy.reset()
        observation, info = env.reset()
        while True:
            if not self.queue:
                self.queue.extend(policy.predict(observation, info["instruction"])[: policy.query_interval])
            observation, _, terminated, truncated, info = env.step(self.queue.popleft())
            if terminated or truncated:
                return info["is_success"]


def choosing(name: str, chosen: Callable[[Any, int], Any]) -> type[Loop]:
    """Return a loop that executes something else of Q actions."""
    return type(name, (Loop,), {"chosen": lambda self, actions, interval: chosen(actions, interval)})


SkipsFirst = choosing("SkipsFirst", lambda actions, interval: actions[1 : interval + 1])
WholeChunk = choosing("WholeChunk", lambda actions, interval: actions)
Scaled = choosing(
    "Scaled", lambda actions, interval: [[*row[:3], 0.5 * row[3], *row[4:]] for row in actions[:interval]]
)
Normalised = choosing(  # an action that is too large is scaled as a whole
    "Normalised",
    lambda actions, interval: [row / max(1, 1.2 * abs(row[:6]).max()) for row in actions[:interval]],
)


class NoPolicyReset(Loop):
    def begin(self, policy: Any) -> None:
        pass


class ResetsEachQuery(Loop):
    def __call__(self, env: Any, policy: Any) -> Any:
        self.policy = policy
        return super().__call__(env, policy)

    def shown(self, observation: Any) -> Any:
        self.policy.reset()
        return observation


class Restarts(Loop):
    """Resets the environment after its first chunk."""

    def __call__(self, env: Any, policy: Any) -> Any:
        observation, info = env.reset()
        policy.reset()
        for action in policy.predict(observation, info["instruction"])[: policy.query_interval]:
            env.step(action)
        return super().__call__(env, policy)

    def begin(self, policy: Any) -> None:
        pass


class Short(Loop):
    """Stops at the last whole chunk."""

    def __call__(self, env: Any, policy: Any) -> Any:
        policy.reset()
        observation, info = env.reset()
        for _ in range(env.max_steps // policy.query_interval):
            for action in policy.predict(observation, info["instruction"])[: policy.query_interval]:
                observation, _, terminated, truncated, info = env.step(action)
                if terminated or truncated:
                    return info["is_success"]
        return False


class ToTheEnd(Loop):
    """Executes a chunk to its end, and remembers a success."""

    def __call__(self, env: Any, policy: Any) -> Any:
        policy.reset()
        observation, info = env.reset()
        ended = success = False
        while not ended:
            for action in policy.predict(observation, info["instruction"])[: policy.query_interval]:
                observation, _, terminated, truncated, info = env.step(action)
                success |= terminated
                ended |= terminated or truncated
        return success


class AfterReset(Loop):
    """Reads success after the environment has begun the next episode."""

    def result(self, env: Any, info: Any) -> Any:
        _, info = env.reset()
        return info["is_success"]


class Done(Loop):
    """Takes the end of an episode for success."""

    def result(self, env: Any, info: Any) -> Any:
        return True


class Counting(Loop):
    """Takes the seed from the number of episodes."""

    def reset(self, env: Any) -> Any:
        return env.reset(seed=self.played)


class Noisy(Loop):
    """Adds noise of its own to the images."""

    def __init__(self) -> None:
        super().__init__()
        self.generator = np.random.default_rng(0)

    def shown(self, observation: Any) -> Any:
        image = observation["agentview_image"]
        noise = self.generator.integers(0, 3, image.shape, dtype=np.uint8)
        return {**observation, "agentview_image": image + noise}
