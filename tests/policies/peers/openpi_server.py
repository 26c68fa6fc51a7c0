"""A server of openpi's protocol in openpi's own code, with a policy that costs nothing; prints its port.

    python openpi_server.py [FOLDER]

What the policy is shown lies in FOLDER afterwards, one file for each call.
"""

from __future__ import annotations

import socket
import sys
from pathlib import Path
from typing import Any

import numpy as np
from openpi.serving.websocket_policy_server import WebsocketPolicyServer
from openpi_client import base_policy

GOAL = np.array([0.1, -0.1, 0.5])
METADATA = {"reset_pose": [0, -1.5, 1.5, 0, 0, 0]}


class Reach(base_policy.BasePolicy):  # type: ignore[misc]  # untyped where openpi-client is not installed
    """Moves the hand towards a place and closes the gripper; a chunk of ten actions."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._calls = 0

    def infer(self, obs: dict[str, Any]) -> dict[str, Any]:
        if obs["prompt"] == "fail":
            raise RuntimeError("out of memory")
        if self._folder is not None:
            shown = {key.replace("/", "."): value for key, value in obs.items()}
            np.savez(self._folder / f"{self._calls:04d}.npz", **shown)
        self._calls += 1
        move = np.clip((GOAL - obs["observation/state"][:3]) / 0.05, -1, 1)
        return {"actions": np.tile([*move, 0, 0, 0, 1], (10, 1)), "policy_timing": {"infer_ms": 0.1}}

    def reset(self) -> None:
        pass


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def main(folder: str | None = None) -> None:
    policy, port = Reach(None if folder is None else Path(folder)), free_port()
    print("port", port, flush=True)
    WebsocketPolicyServer(policy, "127.0.0.1", port, METADATA).serve_forever()


if __name__ == "__main__":
    main(*sys.argv[1:])
