"""A small policy of LeRobot with random weights, asked by the adapter and by LeRobot's own evaluation.

    python lerobot_own.py ADAPTER FOLDER

FOLDER gets the checkpoint, as ``save_pretrained`` leaves it, with its processors. What is printed, as JSON:
the actions of the adapter, and those that LeRobot's evaluation gets one by one for the same observation.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.utils import preprocess_observation
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors
from lerobot.processor.env_processor import LiberoProcessorStep

from pytest_libero_max import Episode, Query

SIDE, CHUNK = 64, 8


def write(folder: Path) -> None:
    """Write the checkpoint."""
    torch.manual_seed(0)
    image = PolicyFeature(FeatureType.VISUAL, (3, SIDE, SIDE))
    config = ACTConfig(
        input_features={
            "observation.images.image": image,
            "observation.images.image2": image,
            "observation.state": PolicyFeature(FeatureType.STATE, (8,)),
        },
        output_features={"action": PolicyFeature(FeatureType.ACTION, (7,))},
        device="cpu",
        chunk_size=CHUNK,
        n_action_steps=CHUNK // 2,
        pretrained_backbone_weights=None,
        dim_model=32,
        n_heads=2,
        dim_feedforward=64,
        n_encoder_layers=1,
        n_vae_encoder_layers=1,
        latent_dim=4,
    )
    stats = {
        name: {"mean": torch.zeros(shape), "std": torch.full(shape, scale)}
        for name, shape, scale in (
            ("observation.images.image", (3, 1, 1), 1.0),
            ("observation.images.image2", (3, 1, 1), 1.0),
            ("observation.state", (8,), 2.0),
            ("action", (7,), 0.5),
        )
    }
    before, after = make_pre_post_processors(config, dataset_stats=stats)
    ACTPolicy(config).save_pretrained(folder)
    before.save_pretrained(folder)
    after.save_pretrained(folder)


def observation() -> dict[str, Any]:
    generator = np.random.default_rng(1)
    scene, wrist = generator.integers(0, 256, (2, SIDE, SIDE, 3), dtype=np.uint8)
    quaternion = generator.normal(size=4)
    quaternion *= -np.sign(quaternion[3]) / np.linalg.norm(quaternion)  # w < 0: the two rules differ
    return {
        "agentview_image": scene,
        "robot0_eye_in_hand_image": wrist,
        "robot0_eef_pos": np.array([0.1, 0.2, 0.9]),
        "robot0_eef_quat": quaternion,
        "robot0_gripper_qpos": np.array([0.04, -0.03]),
    }


def by_lerobot(folder: Path, seen: dict[str, Any]) -> Any:
    """What LeRobot's evaluation executes until the next query."""
    policy = ACTPolicy.from_pretrained(folder)
    before, after = make_pre_post_processors(policy.config, str(folder))
    asked = preprocess_observation(
        {
            "pixels": {
                "image": seen["agentview_image"],
                "image2": seen["robot0_eye_in_hand_image"],
            },
            "robot_state": {
                "eef": {"pos": seen["robot0_eef_pos"][None], "quat": seen["robot0_eef_quat"][None]},
                "gripper": {"qpos": seen["robot0_gripper_qpos"][None]},
            },
        }
    )
    asked = LiberoProcessorStep().observation(asked)
    with torch.inference_mode():
        actions = [
            after(policy.select_action(before({**asked, "task": "do it"})))
            for _ in range(policy.config.n_action_steps)
        ]
    return torch.cat(actions).tolist()


def by_adapter(path: str, folder: Path, seen: dict[str, Any]) -> Any:
    """What the adapter returns."""
    os.environ["LEROBOT_CHECKPOINT"] = str(folder)
    spec = importlib.util.spec_from_file_location("adapter", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    policy = module.policy()
    policy.reset(Episode("libero_goal", 0, "do it", 7, 300))
    assert (policy.spec.horizon, policy.spec.query_interval) == (CHUNK, CHUNK // 2)
    return policy.predict(seen, Query(0, 0, "do it", 5)).tolist()


def main(adapter: str, name: str) -> None:
    folder, seen = Path(name), observation()
    write(folder)
    print(json.dumps({"adapter": by_adapter(adapter, folder, seen), "lerobot": by_lerobot(folder, seen)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
