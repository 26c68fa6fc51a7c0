"""Published clients that ask a server of ours; each prints the actions of its answers as JSON.

python clients.py openpi PORT
python clients.py vla-eval PORT
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np


def shown(size: int = 32) -> dict[str, Any]:
    """An observation as the profile ``served`` sends it."""
    image = np.arange(size * size * 3, dtype=np.uint8).reshape(size, size, 3)
    return {
        "agentview_image": image,
        "robot0_eye_in_hand_image": image[::-1],
        "robot0_eef_pos": np.array([0.1, 0.2, 0.9]),
        "robot0_eef_quat": np.array([1.0, 0.0, 0.0, 0.0]),
        "robot0_gripper_qpos": np.array([0.04, -0.04]),
    }


def openpi(port: int) -> list[Any]:
    from openpi_client.websocket_client_policy import WebsocketClientPolicy

    client = WebsocketClientPolicy("127.0.0.1", port)
    assert client.get_server_metadata()["spec"]["name"] == "sound"
    request = {
        "observation": shown(),
        "prompt": "do it",
        "query": {"index": 0, "step": 0, "seed": 5},
        "episode": {
            "suite": "libero_goal",
            "task_index": 1,
            "instruction": "do it",
            "seed": 7,
            "max_steps": 300,
        },
    }
    return [client.infer(request)["actions"].tolist() for _ in range(2)]


async def vla_eval(port: int) -> list[Any]:
    """Five steps of an episode, as vla-eval's runner takes them."""
    from vla_eval.connection import Connection

    seen = shown()
    observation = {
        "images": {
            "agentview": seen["agentview_image"][::-1, ::-1],
            "wrist": seen["robot0_eye_in_hand_image"][::-1, ::-1],
        },
        "task_description": "do it",
        "states": np.array([0.1, 0.2, 0.9, np.pi, 0.0, 0.0, 0.04, -0.04]),
    }
    async with Connection(f"ws://127.0.0.1:{port}/vla-eval") as connection:
        task = {"name": "x", "suite": "libero_goal", "task_id": 1, "episode_idx": 7}
        await connection.start_episode({"task": task})
        return [(await connection.act({**observation, "seed": 5}))["actions"].tolist() for _ in range(5)]


if __name__ == "__main__":
    kind, number = sys.argv[1:]
    if kind == "openpi":
        print(json.dumps(openpi(int(number))))
    else:
        import anyio

        print(json.dumps(anyio.run(vla_eval, int(number))))
