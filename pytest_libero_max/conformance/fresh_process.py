"""A function of this room in another process, with an empty home. Arguments: MODULE FUNCTION TEXT FILE."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from pytest_libero_max.conformance.rules import Finding, broken, unexamined
from pytest_libero_max.runs.fresh_place import fresh_place

_FILE = "result.json"

_HASH_SEEDS = ("20", "21")
"""Seeds of the hashes of the process, of which it gets the one that this process has not."""


def result_elsewhere(
    function: Callable[[str], Any],
    text: str,
    timeout_s: float,
    *,
    expected: str,
    cure: str,
    environment: Mapping[str, str] | None = None,
) -> Any | Finding:
    """Return what a function makes of a text in another process, through JSON; a finding where it fails.

    The process has other hashes of texts than this one, and its import path, for modules beside tests or in
    the working folder.
    """
    with fresh_place() as (folder, fresh):
        fresh["PYTHONHASHSEED"] = _HASH_SEEDS[os.environ.get("PYTHONHASHSEED") == _HASH_SEEDS[0]]
        fresh["PYTHONPATH"] = os.pathsep.join(str(Path(path).absolute()) for path in sys.path)
        try:
            ended = subprocess.run(
                [sys.executable, "-m", __name__, function.__module__, function.__name__, text, _FILE],
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
            status = f"a fresh process with an empty home ended with status {ended.returncode}"
            return broken(f"{status}: {last}", expected, cure)
        return json.loads((folder / _FILE).read_text(encoding="utf-8"))


if __name__ == "__main__":
    module, name, text, file = sys.argv[1:]
    result = getattr(import_module(module), name)(text)
    Path(file).write_text(json.dumps(result), encoding="utf-8")
