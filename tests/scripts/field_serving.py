"""Serves a toy model by the code of others; prints its package and version, and its port.

    PYTHON field_serving.py KIND

PYTHON is one in which the package of KIND is installed; nothing of this project is needed there. The model is
a function of image and state with ten actions, and takes 0.1 s. ``lerobot`` is a random ACT network, in
LeRobot's code behind vla-eval's bridge.
"""

from __future__ import annotations

import importlib
import socket
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numpy as np

COMPUTES_S = 0.1


def actions_for(image: Any, state: Any, computes_s: float = COMPUTES_S) -> Any:
    """The toy model's ten actions."""
    time.sleep(computes_s)
    seed = [
        int(np.asarray(image, dtype=np.int64).sum()),
        int(1e6 * abs(np.asarray(state, dtype=float).sum())),
    ]
    actions = np.random.default_rng(seed).uniform(-0.5, 0.5, (10, 7))
    actions[:, 6] = -1.0
    return actions


class Policy:
    """The toy model with the methods of openpi's policies."""

    def infer(self, observation: Any) -> Any:
        return {"actions": actions_for(observation["observation/image"], observation["observation/state"])}

    def reset(self) -> None:
        pass


def openpi(module: str) -> None:
    """Serve with a server of openpi's protocol, as three packages have one."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    server = importlib.import_module(module).WebsocketPolicyServer(Policy(), "127.0.0.1", port, {})
    print("port", port, flush=True)
    server.serve_forever()


def vla_eval(chunk: int | None, batch: int) -> None:
    """Serve with vla-eval's server: chunks or single actions, queries alone or in batches."""
    from vla_eval import specs
    from vla_eval.model_servers.predict import PredictModelServer

    class Toy(PredictModelServer):  # type: ignore[misc]  # untyped where vla-eval is not installed
        def get_observation_params(self) -> dict[str, Any]:
            return {"send_wrist_image": True, "send_state": True}

        def get_action_spec(self) -> dict[str, Any]:
            return {
                "position": specs.POSITION_DELTA,
                "rotation": specs.ROTATION_AA,
                "gripper": specs.GRIPPER_CLOSE_POS,
            }

        def get_observation_spec(self) -> dict[str, Any]:
            return {"agentview": specs.IMAGE_RGB, "state": specs.STATE_EEF_POS_AA_GRIP}

        def predict(self, obs: Any, ctx: Any) -> Any:
            return {"actions": actions_for(obs["images"]["agentview"], obs["states"])}

    class InBatches(Toy):
        def predict_batch(self, obs_batch: Any, ctx_batch: Any) -> Any:
            share_s = COMPUTES_S / len(obs_batch)
            return [
                {"actions": actions_for(obs["images"]["agentview"], obs["states"], share_s)}
                for obs in obs_batch
            ]

    if batch > 1:
        _serve(InBatches(chunk_size=chunk, max_batch_size=batch, max_wait_time=0.02))
    else:
        _serve(Toy(chunk_size=chunk))


def lerobot() -> None:
    """Serve a network of LeRobot with random weights by vla-eval's bridge."""
    import torch
    from lerobot.configs.types import FeatureType, PolicyFeature
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors
    from vla_eval.model_servers.lerobot import LeRobotModelServer

    torch.manual_seed(0)
    torch.set_num_threads(1)
    images = ("agentview", "wrist")
    features = {
        f"observation.images.{name}": PolicyFeature(type=FeatureType.VISUAL, shape=(3, 96, 96))
        for name in images
    }
    config = ACTConfig(
        chunk_size=10,
        n_action_steps=10,
        pretrained_backbone_weights=None,
        dim_model=64,
        n_heads=4,
        dim_feedforward=128,
        n_encoder_layers=1,
        use_vae=False,
        device="cpu",
        input_features={**features, "observation.state": PolicyFeature(type=FeatureType.STATE, shape=(8,))},
        output_features={"action": PolicyFeature(type=FeatureType.ACTION, shape=(7,))},
    )
    shapes = {"observation.state": (8,), "action": (7,), **dict.fromkeys(features, (3, 1, 1))}
    statistics = {
        name: {
            "mean": torch.zeros(shape),
            "std": torch.full(shape, 0.2 if name == "action" else 1.0),
            "min": -torch.ones(shape),
            "max": torch.ones(shape),
        }
        for name, shape in shapes.items()
    }
    with tempfile.TemporaryDirectory() as folder:
        for part in (ACTPolicy(config), *make_pre_post_processors(config, dataset_stats=statistics)):
            part.save_pretrained(folder)
        server = LeRobotModelServer("act", folder, image_keys={name: name for name in images}, device="cpu")
        _serve(server)


def _serve(server: Any) -> None:
    import anyio
    from vla_eval.model_servers.serve import serve_async

    async def run() -> None:
        async with anyio.create_task_group() as group:
            print("port", await group.start(serve_async, server, "127.0.0.1", 0), flush=True)

    anyio.run(run)


KINDS: dict[str, tuple[str, str, Callable[[], None]]] = {
    "openpi": ("rlinf-openpi", "openpi", lambda: openpi("openpi.serving.websocket_policy_server")),
    "openpi-server": ("openpi-server", "openpi", lambda: openpi("openpi_server")),
    "policy-websocket": ("policy-websocket", "openpi", lambda: openpi("policy_websocket")),
    "vla-eval": ("vla-eval", "vla-eval", lambda: vla_eval(None, 1)),
    "vla-eval-singly": ("vla-eval", "vla-eval", lambda: vla_eval(10, 1)),
    "vla-eval-batches": ("vla-eval", "vla-eval", lambda: vla_eval(None, 4)),
    "lerobot": ("lerobot", "vla-eval", lerobot),
}
"""Package, protocol and server of each kind."""


if __name__ == "__main__":
    package, _, serve = KINDS[sys.argv[1]]
    print("version", package, version(package), flush=True)
    serve()
