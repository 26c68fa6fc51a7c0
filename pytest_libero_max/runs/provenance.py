"""Provenance of a result: versions, machine, code, case set, policy and command."""

from __future__ import annotations

import os
import platform
import re
import subprocess
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.order import SORTED_NAME

PACKAGES = (
    "pytest-libero-max",
    "mujoco",
    "robosuite",
    "numpy",
    "scipy",
    "numba",
    "opencv-python-headless",
    "pytest",
    "pytest-xdist",
)

_SECRET = r"(?:[\w-]*(?:token|secret|passw(?:or)?d|api[-_]?key|credential|authorization)[\w-]*)"
_SECRET_OPTION = re.compile(rf"-{{1,2}}{_SECRET}", re.IGNORECASE)
_SECRET_VALUE = re.compile(rf"({_SECRET})([=:])[^&\s]+", re.IGNORECASE)
_URL_USER = re.compile(r"://[^/@\s]+@")


def collect(
    *,
    policy: Json,
    substrate: Json,
    scores: Json,
    case_set: Json,
    protocol: Json,
    command: Sequence[str],
    selection: Json | None = None,
    order: str = SORTED_NAME,
    stopping_rule: str | None = None,
    gates: Sequence[str] = (),
    gl_backend: str | None = None,
    started: datetime | None = None,
    folder: Path | None = None,
) -> Json:
    """Gather the provenance of a run. Imports none of the packages whose versions it names.

    Args:
        command: The command line; secrets and the home folder are taken out.
        gates: Gates of a shard, which are decided where all shards are joined, or of a run whose stopping
            rule decides gates.
        folder: Folder whose git state is recorded; by default the working directory.
    """
    begun = datetime.now(UTC) if started is None else started.astimezone(UTC)
    return {
        "started": begun.isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version(), **package_versions()},
        "platform": {
            "system": platform.system(),
            "machine": platform.machine(),
            "libc": platform.libc_ver()[1],
            "processor": processor(),
            "cores": os.cpu_count(),
        },
        "gl_backend": gl_backend if gl_backend is not None else os.environ.get("MUJOCO_GL"),
        "git": git_state(folder or Path.cwd()),
        "substrate": _public_values(substrate),
        "scores": scores,
        "case_set": _public_values(case_set),
        **({} if selection is None else {"selection": selection}),
        "order": order,
        **({} if stopping_rule is None else {"stopping_rule": stopping_rule}),
        **({"gates": list(gates)} if gates else {}),
        "policy": _public_values(policy),
        "protocol": protocol,
        "command": redacted(command),
    }


def package_versions(packages: Sequence[str] = PACKAGES) -> dict[str, str | None]:
    """Installed version by distribution name; None where it is not installed."""
    versions: dict[str, str | None] = {}
    for name in packages:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = None
    return versions


def git_state(folder: Path) -> Json | None:
    """Commit of the repository around ``folder`` and whether files differ from it; None outside of one."""
    commit = _git(folder, "rev-parse", "HEAD")
    status = _git(folder, "status", "--porcelain")
    if commit is None or status is None:
        return None
    return {"commit": commit, "dirty": bool(status)}


def commit_text(git: Json) -> str:
    """Return the commit of a :func:`git_state` as pages name it."""
    return f"{git['commit'][:12]}{' with changes' if git.get('dirty') else ''}"


def redacted(command: Sequence[str], environment: Mapping[str, str] | None = None) -> list[str]:
    """Return a command line fit to be published: no value of a secret, no user in a URL, no home folder."""
    return [
        "***" if index and _SECRET_OPTION.fullmatch(command[index - 1]) else _public(argument, environment)
        for index, argument in enumerate(command)
    ]


def processor() -> str | None:
    """Return the processor's name; None where the system does not tell."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return platform.processor() or None
    names = re.findall(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return names[0].strip() if names else None


def _public_values(values: Json) -> Json:
    """Texts and lists of texts without secrets and without the home folder."""
    cleaned: Json = {}
    for key, value in values.items():
        if isinstance(value, list):
            cleaned[key] = [_public(item) if isinstance(item, str) else item for item in value]
        else:
            cleaned[key] = _public(value) if isinstance(value, str) else value
    return cleaned


def _public(text: str, environment: Mapping[str, str] | None = None) -> str:
    home = (os.environ if environment is None else environment).get("HOME", "")
    cleaned = _SECRET_VALUE.sub(r"\1\2***", _URL_USER.sub("://***@", text))
    return cleaned.replace(home, "~") if len(home) > 1 else cleaned


def _git(folder: Path, *arguments: str) -> str | None:
    try:
        result = subprocess.run(
            ["git", *arguments], cwd=folder, capture_output=True, text=True, timeout=10, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.strip()
