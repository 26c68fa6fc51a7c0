"""LeRobot's own trainer, with pairs and without: ``python lerobot_training.py FOLDER``, where LeRobot is.

The folder holds ``tiny.json``. What is printed, as JSON: the evaluations, and True where both trainings
ended with the same weights.
"""

from __future__ import annotations

import json
import logging
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.scripts import lerobot_train
from safetensors.torch import load_file

from pytest_libero_max.benchmark import cases
from pytest_libero_max.lab.training.lerobot import evaluated_training

SIDE, STEPS, EVERY, BUDGET = 64, 4, 2, 12

IMAGE = {"dtype": "image", "shape": (SIDE, SIDE, 3), "names": ["height", "width", "channels"]}
FEATURES = {
    "observation.images.image": IMAGE,
    "observation.images.image2": IMAGE,
    "observation.state": {"dtype": "float32", "shape": (8,), "names": None},
    "action": {"dtype": "float32", "shape": (7,), "names": None},
}

ARGUMENTS = f"""
--dataset.repo_id=none/drawn --dataset.root=data --batch_size=4 --steps={STEPS} --num_workers=0 --seed=1
--log_freq=1 --save_freq={STEPS} --env_eval_freq=0 --wandb.enable=false --policy.push_to_hub=false
--policy.type=act --policy.device=cpu --policy.chunk_size=8 --policy.n_action_steps=4 --policy.dim_model=32
--policy.n_heads=2 --policy.dim_feedforward=64 --policy.n_encoder_layers=1 --policy.n_vae_encoder_layers=1
--policy.latent_dim=4 --policy.pretrained_backbone_weights=null
"""


def write_data() -> None:
    """Write two drawn episodes."""
    data = LeRobotDataset.create("none/drawn", fps=20, features=FEATURES, root="data", use_videos=False)
    draw = np.random.default_rng(0)
    for _ in range(2):
        for _ in range(12):
            frame: dict[str, Any] = {
                name: draw.integers(0, 256, (SIDE, SIDE, 3), dtype=np.uint8)
                for name in ("observation.images.image", "observation.images.image2")
            }
            frame["observation.state"] = draw.normal(size=8).astype(np.float32)
            frame["action"] = draw.uniform(-1, 1, 7).astype(np.float32)
            data.add_frame({**frame, "task": "put the box on the plate"})
        data.save_episode()
    data.finalize()


def train(output: str) -> dict[str, Any]:
    """Train, and return the weights."""
    sys.argv = ["lerobot-train", *ARGUMENTS.split(), f"--output_dir={output}"]
    lerobot_train.main()
    weights: dict[str, Any] = load_file(
        Path(output, "checkpoints", f"{STEPS:06d}", "pretrained_model", "model.safetensors")
    )
    return weights


def main(folder: str) -> None:
    os.chdir(folder)
    cases.step_budget = lambda suite: BUDGET
    write_data()
    with evaluated_training(
        every=EVERY, manifest="tiny.json", substrate="tiny", limit=2, folder="runs"
    ) as paired:
        logging.getLogger("pytest_libero_max").setLevel(logging.INFO)
        weights = train("with")
    alone = train("without")
    same = all(torch.equal(values, alone[name]) for name, values in weights.items())
    history = [(each.step, str(each), each.numbers) for each in paired[0].history]
    print(json.dumps({"history": history, "same": same, "parameters": len(weights)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
