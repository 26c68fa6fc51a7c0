"""A module of this room in a process of its own, with an empty home."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pytest_libero_max.conformance.rules import Finding, broken, unexamined
from pytest_libero_max.runs.fresh_place import fresh_place

_FILE = "result.json"

_HASH_SEED = "20"
"""Seed of the hashes of the process, which differ from those of this one."""

_SECOND_HASH_SEED = "21"
"""The same, where this process has the first."""


def result_elsewhere(
    module: str,
    argument: str,
    timeout_s: float,
    *,
    expected: str,
    cure: str,
    environment: Mapping[str, str] | None = None,
) -> Any | Finding:
    """Run a module with an argument and a file to write, and return what it wrote as JSON.

    It has other hashes of texts than this process, and its import path, for modules beside tests or in the
    working folder.

    Args:
        module: Its dotted name.
        argument: Its first argument.
        timeout_s: Longest time of the process, s.
        expected: The rule, where the process fails.
        cure: Likewise.
        environment: Variables that the process has besides.

    Returns:
        The result, or a finding where there is none.
    """
    with fresh_place() as (folder, fresh):
        shared = os.environ.get("PYTHONHASHSEED") == _HASH_SEED
        fresh["PYTHONHASHSEED"] = _SECOND_HASH_SEED if shared else _HASH_SEED
        fresh["PYTHONPATH"] = os.pathsep.join(str(Path(path).absolute()) for path in sys.path)
        try:
            ended = subprocess.run(
                [sys.executable, "-m", module, argument, _FILE],
                cwd=folder,
                env=fresh | dict(environment or {}),
                capture_output=True,
                text=True,
                timeout=timeout_s,
            )
        except subprocess.TimeoutExpired:
            return unexamined(f"the fresh process did not end within {timeout_s:.0f} s")
        if ended.returncode:
            last = (ended.stderr.strip().splitlines() or ["no message"])[-1]
            return broken(
                f"a fresh process with an empty home ended with status {ended.returncode}: {last}",
                expected,
                cure,
            )
        return json.loads((folder / _FILE).read_text(encoding="utf-8"))
