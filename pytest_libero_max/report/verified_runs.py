"""Checks of published runs that played pairs again: noted by ``publish verify``, read by an index."""

from __future__ import annotations

import hashlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from pytest_libero_max.benchmark.documents import read_content
from pytest_libero_max.benchmark.structs import decode_json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.writers.report_files import write_text
from pytest_libero_max.runs.outside import require_inside
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME


class PlayedAgain(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A check of a published run in which pairs were played again and all ended alike."""

    pairs: int
    seed: str
    """By which they were drawn."""
    date: str
    """Day of the check, UTC."""
    package: str
    mujoco: str
    actions: bool = False
    """True if the recorded actions were executed, and no policy asked."""


def pairs_digest(folder: Path) -> str:
    """Return the SHA-256 of the pairs of a published run, unpacked: a check belongs to these bytes alone."""
    try:
        return hashlib.sha256(read_content(require_inside(folder, folder / PACKED_PAIRS_NAME))).hexdigest()
    except OSError as error:
        raise ReportError(f"Cannot read {folder / PACKED_PAIRS_NAME}: {error}.") from error


def read_checks(path: Path) -> dict[str, PlayedAgain]:
    """Return the checks that :func:`note_check` wrote, by digest; none where the file does not exist.

    Raises:
        ReportError: It cannot be read.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ReportError(f"Cannot read {path}: {error}.") from error
    cure = "libero-max publish verify FOLDER --record writes such a file."
    try:
        values: Any = decode_json(content, cure)
        return msgspec.convert(values, dict[str, PlayedAgain])
    except (ReportError, msgspec.ValidationError) as error:
        raise ReportError(f"{path} holds no checks of published runs: {error}. {cure}") from error


def note_check(path: Path, folder: Path, pairs: int, seed: str, actions: bool) -> None:
    """Note in a file that pairs of a published run were played again and ended alike.

    Args:
        path: The file; the checks of other runs stay in it.

    Raises:
        ReportError: The file cannot be read or written.
    """
    from importlib.metadata import version

    today, package, mujoco = (
        datetime.now(UTC).date().isoformat(),
        version("pytest-libero-max"),
        version("mujoco"),
    )
    check = PlayedAgain(pairs, seed, today, package, mujoco, actions)
    checks = read_checks(path) | {pairs_digest(folder): check}
    text = json.dumps(msgspec.to_builtins(checks), indent=1, sort_keys=True)
    write_text(path, f"{text}\n")
