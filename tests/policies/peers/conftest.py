from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

HERE = Path(__file__).parent
PYTHON = os.environ.get("LIBERO_MAX_TEST_PEERS", sys.executable)
"""The Python that runs the scripts of this folder."""

Seen = Callable[[], list[dict[str, Any]]]


def require(module: str) -> None:
    """Skip where the scripts' Python lacks a module."""
    found = subprocess.run([PYTHON, "-c", f"import {module}"], capture_output=True, check=False)
    if found.returncode:
        pytest.skip(f"needs {module}, see .ci/peers.txt")


@contextmanager
def peer(script: str, *arguments: str) -> Iterator[int]:
    """A script of this folder that serves; its port."""
    process = subprocess.Popen(
        [PYTHON, str(HERE / script), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        if not said.startswith("port "):
            pytest.fail(f"{script} did not start: {process.communicate(timeout=10)[1][-2000:]}")
        yield int(said.split()[1])
    finally:
        process.terminate()
        process.communicate(timeout=10)


def shown(folder: Path) -> list[dict[str, Any]]:
    """What the model of a server was shown, call by call."""
    calls = []
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as file:
            calls.append({key: file[key] for key in file.files})
    return calls


def nested(call: dict[str, Any]) -> dict[str, Any]:
    """``{"images.x": 1}`` as ``{"images": {"x": 1}}``, texts as texts."""
    result: dict[str, Any] = {}
    for key, value in call.items():
        value = str(value) if value.dtype.kind == "U" else value
        first, _, rest = key.partition(".")
        if rest:
            result.setdefault(first, {})[rest] = value
        else:
            result[key] = value
    return result
