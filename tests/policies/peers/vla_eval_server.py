"""A model server of vla-eval with a model that costs nothing; prints its port.

    python vla_eval_server.py MODEL CHUNK_SIZE [FOLDER]

MODEL is ``reach`` or ``xvla``, which is vla-eval's own server of X-VLA on LIBERO, pre- and postprocessing as
published, with a stand-in for the weights. CHUNK_SIZE is that of the server, 0 for none. What the model is
shown lies in FOLDER afterwards, one file for each call.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import anyio
import numpy as np
from vla_eval import specs
from vla_eval.model_servers.predict import PredictModelServer
from vla_eval.model_servers.serve import serve_async

GOAL = np.array([0.1, -0.1, 0.5])
"""Where ``reach`` moves the hand, m."""

POSE = np.array([0.15, -0.25, 0.65, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.7, *[9.0] * 10], dtype=np.float32)
"""What ``xvla`` returns: position, two columns, the chance that the gripper closes, a second arm."""


class Calls:
    """Keeps what a model is shown."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._count = 0

    def keep(self, **shown: Any) -> None:
        if self._folder is not None:
            np.savez(self._folder / f"{self._count:04d}.npz", **shown)
        self._count += 1


class Reach(PredictModelServer):  # type: ignore[misc]  # untyped where vla-eval is not installed
    """Moves the hand towards a place and closes the gripper; a chunk of ten actions."""

    def __init__(self, chunk_size: int | None, calls: Calls) -> None:
        super().__init__(chunk_size=chunk_size)
        self._calls = calls

    def get_observation_params(self) -> dict[str, Any]:
        return {"send_wrist_image": True, "send_state": True}

    def get_action_spec(self) -> dict[str, Any]:
        return {
            "position": specs.POSITION_DELTA,
            "rotation": specs.ROTATION_AA,
            "gripper": specs.GRIPPER_CLOSE_POS,
        }

    def get_observation_spec(self) -> dict[str, Any]:
        return {
            "agentview": specs.IMAGE_RGB,
            "wrist": specs.IMAGE_RGB,
            "state": specs.STATE_EEF_POS_AA_GRIP,
            "language": specs.LANGUAGE,
        }

    def predict(self, obs: Any, ctx: Any) -> Any:
        flat = {f"images.{key}": image for key, image in obs["images"].items()}
        self._calls.keep(**flat, **{key: value for key, value in obs.items() if key != "images"})
        move = np.clip((GOAL - obs["states"][:3]) / 0.05, -1, 1)
        return {"actions": np.tile([*move, 0, 0, 0, 1], (10, 1))}


class Weights:
    """In place of X-VLA's: keeps what it is shown, and returns POSE thirty times."""

    action_space = SimpleNamespace(dim_action=20)

    def __init__(self, calls: Calls) -> None:
        self._calls = calls

    def to(self, *where: Any, **how: Any) -> Weights:
        return self

    def eval(self) -> Weights:
        return self

    def parameters(self) -> Any:
        import torch

        return iter([torch.zeros(1)])

    def generate_actions(self, **shown: Any) -> Any:
        import torch

        self._calls.keep(**{key: np.asarray(value) for key, value in shown.items()})
        return torch.from_numpy(np.tile(POSE, (1, 30, 1)))


def xvla(chunk_size: int | None, calls: Calls) -> Any:
    """vla-eval's server of X-VLA, which finds the stand-in where it looks for weights."""

    def process(images: Any, language_instruction: str) -> dict[str, Any]:
        scene, wrist = (np.asarray(image) for image in images)
        return {"scene": scene, "wrist": wrist, "language": language_instruction}

    transformers = ModuleType("transformers")
    for name, value in {
        "AutoConfig": object(),
        "AutoModel": Weights(calls),
        "AutoProcessor": process,
    }.items():
        loader = SimpleNamespace(from_pretrained=lambda *_, value=value, **__: value)
        setattr(transformers, name, loader)
    sys.modules["transformers"] = transformers
    from vla_eval.model_servers.xvla import XVLAModelServer

    return XVLAModelServer(benchmark_profile="libero", domain_id=3, chunk_size=chunk_size or 30)


async def main(server: Any) -> None:
    async with anyio.create_task_group() as group:
        print("port", await group.start(serve_async, server, "127.0.0.1", 0), flush=True)


if __name__ == "__main__":
    model, size, *folder = sys.argv[1:]
    make = {"reach": Reach, "xvla": xvla}[model]
    anyio.run(main, make(int(size) or None, Calls(Path(folder[0]) if folder else None)))
