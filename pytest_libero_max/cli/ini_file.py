"""One option of pytest's ini file, and the gates in it, for commands that run without pytest."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import iniconfig  # installed with pytest, which reads its own files with it

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.report.gates import Gate

_NAMES = (
    "pytest.toml",
    ".pytest.toml",
    "pytest.ini",
    ".pytest.ini",
    "pyproject.toml",
    "tox.ini",
    "setup.cfg",
)


def gates_of(asked: Sequence[str], start: Path) -> tuple[tuple[Gate, ...], Path]:
    """Return the gates of a command, or those of the ini file, and the folder that paths in them begin at."""
    from pytest_libero_max.report.gates import parse_gates

    texts, folder = (asked, start) if asked else ini_lines("libero_max_gate", start)
    return parse_gates(texts), folder


def ini_lines(option: str, start: Path) -> tuple[list[str], Path]:
    """Return the lines of an option, empty where it is not set, and the folder of the file.

    As pytest does, reads one file: the first in ``start`` or the nearest folder above that has settings for
    pytest.

    Raises:
        OptionError: That file cannot be read.
    """
    for folder in (start, *start.parents):
        path = settings_file(folder)
        if path is not None:
            value = (_settings(path) or {}).get(option, [])
            lines = value if isinstance(value, list) else str(value).splitlines()
            return [*map(str, lines)], folder
    return [], start


def settings_file(folder: Path) -> Path | None:
    """Return the file of a folder that pytest reads its settings from; None where there is none.

    Raises:
        OptionError: A file that may have them cannot be read.
    """
    for name in _NAMES:
        path = folder / name
        if path.is_file():
            try:
                settings = _settings(path)
            except (OSError, ValueError, RecursionError, iniconfig.ParseError) as error:
                raise OptionError(f"Cannot read {path}: {error}. Mend it or give the option.") from error
            if settings is not None:
                return path
    return None


def _settings(path: Path) -> dict[str, object] | None:
    if path.suffix == ".toml":
        document = tomllib.loads(read_text(path))
        if path.name != "pyproject.toml":
            return dict(document.get("pytest", {}))
        tool = document.get("tool", {}).get("pytest")
        return None if tool is None else dict(tool.get("ini_options", tool))
    sections = iniconfig.IniConfig(str(path), data=read_text(path))
    name = "tool:pytest" if path.name == "setup.cfg" else "pytest"
    if name in sections:
        return dict(sections[name].items())
    return {} if path.name in ("pytest.ini", ".pytest.ini") else None
