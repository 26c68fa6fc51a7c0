"""Evaluation loops of other packages, as subjects of the rules for loops.

In an environment with LeRobot and this package::

    pytest --libero-max-conform=loop:tests.scripts.field_loops:lerobot
"""

from __future__ import annotations

from typing import Any

import numpy as np


def lerobot(spied: Any, policy: Any) -> bool:
    """Play an episode by the rollout of ``lerobot-eval``, in a vector environment of one."""
    import gymnasium
    import torch
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, SyncVectorEnv
    from lerobot.scripts.lerobot_eval import rollout

    image = spaces.Box(0, 255, (64, 64, 3), np.uint8)

    class Environment(gymnasium.Env):  # type: ignore[misc]  # untyped where LeRobot is not installed
        metadata = {"render_modes": [], "render_fps": 20}  # noqa: RUF012 - Gymnasium's
        observation_space = spaces.Dict(
            {
                "pixels": spaces.Dict({"image": image, "image2": image}),
                "agent_pos": spaces.Box(-10, 10, (8,), np.float64),
            }
        )
        action_space = spaces.Box(-1, 1, (7,), np.float32)
        task = ""
        _max_episode_steps = spied.max_steps

        @property
        def task_description(self) -> str:
            return str(spied.task_description)

        def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
            observation, info = spied.reset(seed=seed)
            return self._of(observation), info

        def step(self, action: Any) -> Any:
            observation, *rest = spied.step(action)
            return self._of(observation), *rest

        def _of(self, observation: Any) -> dict[str, Any]:
            fingers = observation["robot0_gripper_qpos"]
            return {
                "pixels": {
                    "image": observation["agentview_image"],
                    "image2": observation["robot0_eye_in_hand_image"],
                },
                "agent_pos": np.concatenate((observation["robot0_eef_pos"], np.zeros(3), fingers)),
            }

    class Policy(torch.nn.Module):  # type: ignore[misc]
        def reset(self) -> None:
            policy.reset()

        def select_action(self, observation: dict[str, Any]) -> Any:
            words = observation.pop("task")[0]
            return torch.from_numpy(policy.act(observation, words)[None].astype(np.float32))

    def unchanged(value: Any) -> Any:
        return value

    vector = SyncVectorEnv([Environment], autoreset_mode=AutoresetMode.SAME_STEP)
    steps = (unchanged,) * 4  # processors of environment and policy
    played = rollout(vector, Policy(), *steps, seeds=[1000])
    last = int(played["done"][0].int().argmax())
    return bool(played["success"][0, : last + 1].any())
