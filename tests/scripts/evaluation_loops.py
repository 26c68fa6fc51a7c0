"""The loops of other people as ``docs/how-to/own-loop.md`` prints them, each in an environment of its own.

    python -m tests.scripts.evaluation_loops openpi vla-eval lerobot [--folder FOLDER] [--python PYTHON]

The commands and the Python of a section are run in a copy of the repository. What a reader replaces is
replaced: the model (by one that costs nothing), the track (by a case of ``tiny``) and the number of pairs.
It needs the package index, and LeRobot a Python from 3.12 on.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pytest_libero_max.runs.store import read_pairs
from tests.plugin.conftest import tiny_manifest
from tests.policies.clients import fakes

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "how-to" / "own-loop.md"
RESULTS = "libero-max-results"
PAIRS = 1


def section(title: str) -> str:
    """Return the text of a section of the page, without its heading."""
    text = PAGE.read_text(encoding="utf-8")
    (found,) = re.findall(rf"^## {title}[^\n]*\n(.*?)(?=^## |\Z)", text, re.M | re.S)
    return str(found)


def blocks(text: str, language: str) -> list[str]:
    """Return the fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.M | re.S)


def replaced(text: str, replacements: Mapping[str, str]) -> str:
    """Return a text with what a reader replaces replaced.

    Raises:
        ValueError: The page does not hold it any more.
    """
    for old, new in replacements.items():
        if old not in text:
            raise ValueError(f"{PAGE.name} has no {old!r}: change what this script replaces.")
        text = text.replace(old, new)
    return text


def run(text: str, folder: Path) -> None:
    print(text, flush=True)
    paths = f"{ROOT}{os.pathsep}{ROOT / 'tests' / 'fixtures'}"
    text = text.replace("PYTHONPATH=fixtures/runners", f"PYTHONPATH=fixtures/runners{os.pathsep}{paths}")
    subprocess.run(["bash", "-euo", "pipefail", "-c", text], cwd=folder, check=True)


def vla_eval(folder: Path, python: str) -> None:
    """Play vla-eval's section against its own server of models."""
    text = section("vla-eval")
    (config,) = blocks(text, "yaml")
    tiny = {"cases: lite": "cases: tiny.json, substrate: tiny", "limit: 100": f"limit: {PAIRS}"}
    (folder / "libero_max.yaml").write_text(replaced(config, tiny))
    (commands,) = blocks(text, "sh")
    install, _, play = commands.partition("\n")
    run(replaced(install, {"python3 -m venv": f"{python} -m venv"}), folder)
    with _server(folder / "loops" / "bin" / "python", "vla_eval_server.py", "reach", "5") as port:
        run(replaced(play, {"localhost:8000": f"127.0.0.1:{port}"}), folder)


def openpi(folder: Path, python: str) -> None:
    """Play the loop of openpi's section with openpi's client, asking a policy that this package serves."""
    text = section("openpi's LIBERO client")
    (install,) = blocks(text, "sh")
    (loop,) = blocks(text, "python")
    body = replaced(
        loop,
        {
            '"results"': repr(RESULTS),
            "repeatable=False": "repeatable=False, image_size=64",
            '"lite"': "'tiny.json'",
            "limit=100": f"limit={PAIRS}, substrate='tiny'",
            "        ...  # from t = 0 on, as it is\n": EPISODE,
        },
    )
    (folder / "loop.py").write_text(PROLOGUE + body + "run.close()\n")
    run(replaced(install, {"python3 -m venv": f"{python} -m venv"}), folder)
    with fakes.openpi(_reach) as port:
        run(f"loops/bin/python loop.py {port}\nloops/bin/libero-max report {RESULTS}", folder)


def _reach(request: Mapping[str, Any]) -> dict[str, Any]:
    """Answer as a model that moves the hand to where the box begins."""
    move = np.clip((np.array([0.1, -0.1, 0.5]) - request["observation/state"][:3]) / 0.05, -1, 1)
    return {"actions": np.tile([*move, 0, 0, 0, 1], (10, 1))}


def lerobot(folder: Path, python: str) -> None:
    """Play LeRobot's section with a small ACT of random weights, as ``save_pretrained`` leaves it."""
    (commands,) = blocks(section("LeRobot"), "sh")
    install, _, play = commands.partition("\n")
    run(replaced(install, {"python3 -m venv": f"{python} -m venv"}), folder)
    print(f"lerobot: the environment has {_megabytes(folder / 'lerobot')} MB", flush=True)
    own = ROOT / "tests" / "policies" / "peers" / "lerobot_own.py"
    run(f"PYTHONPATH={ROOT} lerobot/bin/python {own} fixtures/policies/lerobot_policy.py checkpoint", folder)
    run(
        replaced(
            play,
            {
                "--env.task=lite": "--env.task=tiny.json --env.substrate=tiny",
                "--env.limit=100": f"--env.limit={PAIRS}",
                "--env.policy=smolvla --env.query_interval=10": "--env.policy=act --env.query_interval=4",
                "--policy.path=CHECKPOINT --policy.n_action_steps=10": "--policy.path=checkpoint "
                "--policy.n_action_steps=4 --env.observation_height=64 --env.observation_width=64",
                "--eval.batch_size=10": f"--eval.batch_size={PAIRS}",
                "--eval.n_episodes=100": f"--eval.n_episodes={PAIRS}",
            },
        ),
        folder,
    )


def _megabytes(folder: Path) -> int:
    """Size of the files of a folder, MB."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file()) // 1_000_000


@contextlib.contextmanager
def _server(python: Path, script: str, *arguments: str) -> Iterator[str]:
    """Port of a script of ``tests/policies/peers``, run by another Python."""
    path = ROOT / "tests" / "policies" / "peers" / script
    process = subprocess.Popen(
        [str(python), str(path), *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split()[1]
    finally:
        process.terminate()
        process.wait()


PROLOGUE = """
import collections, sys
from types import SimpleNamespace

import numpy as np
from openpi_client import image_tools, websocket_client_policy

from pytest_libero_max import PolicySpec
from pytest_libero_max.gym import LiberoLoop, PairedRun

LIBERO_DUMMY_ACTION = [0.0] * 6 + [-1.0]
args = SimpleNamespace(replan_steps=5, num_steps_wait=10)
client = websocket_client_policy.WebsocketClientPolicy("127.0.0.1", int(sys.argv[1]))
"""

EPISODE = """
        t = 0
        while t < max_steps + args.num_steps_wait:
            if t < args.num_steps_wait:
                obs, reward, done, info = env.step(LIBERO_DUMMY_ACTION)
                t += 1
                continue
            img = np.ascontiguousarray(obs["agentview_image"][::-1, ::-1])
            wrist_img = np.ascontiguousarray(obs["robot0_eye_in_hand_image"][::-1, ::-1])
            img = image_tools.convert_to_uint8(image_tools.resize_with_pad(img, 224, 224))
            wrist_img = image_tools.convert_to_uint8(image_tools.resize_with_pad(wrist_img, 224, 224))
            if not action_plan:
                element = {
                    "observation/image": img,
                    "observation/wrist_image": wrist_img,
                    "observation/state": np.concatenate((obs["robot0_eef_pos"], obs["robot0_gripper_qpos"])),
                    "prompt": str(task_description),
                }
                action_plan.extend(client.infer(element)["actions"][: args.replan_steps])
            obs, reward, done, info = env.step(action_plan.popleft().tolist())
            if done:
                break
            t += 1
"""
"""The episode of openpi's ``examples/libero/main.py``, from ``t = 0`` on, without its films."""

LOOPS: Mapping[str, Callable[[Path, str], None]] = {
    "openpi": openpi,
    "vla-eval": vla_eval,
    "lerobot": lerobot,
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("loops", nargs="+", choices=LOOPS)
    parser.add_argument("--folder", type=Path, help="Where to install and play (default: a temporary folder)")
    parser.add_argument(
        "--python", default=sys.executable, help="Python of the environments (default: this one)"
    )
    options = parser.parse_args()
    for name in options.loops:
        with tempfile.TemporaryDirectory(dir=options.folder) as temporary:
            folder = Path(temporary, "clone")
            ignored = shutil.ignore_patterns(
                ".git", ".venv*", "*.egg-info", "__pycache__", "reports", ".*_cache"
            )
            shutil.copytree(ROOT, folder, ignore=ignored)
            events = ("camera_shift", "target_relocation")
            (folder / "tiny.json").write_text(json.dumps(tiny_manifest(events=events)))
            LOOPS[name](folder, options.python)
            stored = read_pairs(folder / RESULTS)
            assert not stored.errors, stored.errors
            assert len(stored.records) == PAIRS, len(stored.records)
        print(f"{name}: played as the page says", flush=True)


if __name__ == "__main__":
    main()
