"""A policy of LeRobot with its processors, as pairs play it: a checkpoint, or one that is being trained."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray

from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.policies.transforms.images import rotate_180
from pytest_libero_max.policies.transforms.states import axis_angle

if TYPE_CHECKING:
    from pytest_libero_max.worlds.contract import Observation

__all__ = ["LeRobotPolicy"]

CAMERAS = ("agentview", "robot0_eye_in_hand")
"""In the order in which the policy's configuration names its images; LeRobot has ``image`` and ``image2``."""


class LeRobotPolicy:
    """LIBERO's observations in, a chunk of LeRobot's actions out.

    The policy is one for LIBERO as LeRobot has it: one or two images turned by 180 degrees, a state of eight
    numbers, seven actions.

    Args:
        policy: A ``PreTrainedPolicy`` of LeRobot, which may be in training.
        before: Its preprocessor.
        after: Its postprocessor.
        revision: Name of its weights.

    Raises:
        ValueError: The policy keeps earlier observations, or is none for LIBERO.
    """

    def __init__(self, policy: Any, before: Any, after: Any, revision: str | None = None) -> None:
        config = policy.config
        self._policy, self._before, self._after = policy, before, after
        self._images = list(config.image_features)
        self.spec = PolicySpec(
            f"lerobot-{config.type}",
            horizon=getattr(config, "chunk_size", config.n_action_steps),
            query_interval=config.n_action_steps,  # --libero-max-query-interval replaces it
            cameras=CAMERAS[: len(self._images)],
            image_size=require_playable(config),
            revision=revision,
            repeatable=config.device == "cpu",
        )

    def reset(self, episode: Episode) -> None:
        self._policy.reset()

    def predict(self, observation: Observation, query: Query) -> NDArray[Any]:
        asked = {name: as_tensor(image) for name, image in self.model_inputs(observation, query).items()}
        # LeRobot's policies draw their noise from PyTorch's global generator: it is set for this query alone.
        with torch.random.fork_rng(), torch.no_grad():
            torch.manual_seed(query.seed)
            actions = self._policy.predict_action_chunk(self._before({**asked, "task": query.instruction}))
            chunk = self._after(actions)[0]
        values: NDArray[Any] = chunk[: self.spec.horizon].cpu().double().numpy()
        return values

    def model_inputs(self, observation: Observation, query: Query) -> Mapping[str, NDArray[Any]]:
        images = [rotate_180(observation[f"{camera}_image"]) for camera in self.spec.cameras]
        state = [
            observation["robot0_eef_pos"],
            axis_angle(observation["robot0_eef_quat"]),
            observation["robot0_gripper_qpos"],
        ]
        return {
            **dict(zip(self._images, images, strict=True)),
            "observation.state": np.concatenate(state).astype(np.float32),
        }


def as_tensor(value: NDArray[Any]) -> Any:
    """Return an image as (3, S, S) from 0 to 1, anything else unchanged."""
    tensor = torch.from_numpy(np.ascontiguousarray(value))
    return tensor.permute(2, 0, 1).float() / 255 if value.dtype == np.uint8 else tensor


def require_playable(config: Any) -> int:
    """Refuse a policy that is not asked query by query, or not of LIBERO; return the side of its images."""
    if config.n_obs_steps != 1:
        raise ValueError(
            f"n_obs_steps={config.n_obs_steps}, but a query holds one observation. Keep the earlier ones in "
            "an adapter of your own, and give it snapshot() and restore()."
        )
    shapes = {tuple(feature.shape) for feature in config.image_features.values()}
    sides = {side for shape in shapes for side in shape[1:]}
    if len(sides) != 1 or not 1 <= len(config.image_features) <= len(CAMERAS):
        raise ValueError(
            f"images of shapes {sorted(shapes)}, but one or two square ones of one size are drawn."
        )
    state = config.robot_state_feature
    if state is not None and tuple(state.shape) != (8,):
        raise ValueError(f"a state of shape {tuple(state.shape)}, but LIBERO's has 8 numbers.")
    if tuple(config.action_feature.shape) != (7,):
        raise ValueError(
            f"actions of shape {tuple(config.action_feature.shape)}, but LIBERO's have 7 numbers."
        )
    return int(sides.pop())
