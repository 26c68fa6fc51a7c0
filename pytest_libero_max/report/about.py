"""Authors and model of a published run, as whoever publishes it states them: no pair shows either."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import urlsplit

import msgspec

from pytest_libero_max.benchmark.structs import decode_json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.outside import require_inside

ABOUT_NAME = "about.json"

_CURE = "libero-max publish pack RUN FOLDER --authors TEXT --model ADDRESS writes it."


class About(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Statements of whoever publishes a run."""

    authors: str = ""
    """Names, as a text; empty where they are not stated."""
    model: str = ""
    """Address of the model's page, https or http; empty where it is not stated."""

    def __post_init__(self) -> None:
        if self.model and urlsplit(self.model).scheme not in ("http", "https"):
            raise ValueError(
                f"model={self.model!r}, but must be an address on the web, such as https://host/name"
            )

    def to_json(self) -> str:
        """Return the content of the file."""
        return json.dumps(msgspec.to_builtins(self), indent=1) + "\n"


def about_of(folder: Path) -> About:
    """Return what is stated of a published run; nothing where its folder has no such file.

    Raises:
        ReportError: The file cannot be read, or states something else.
    """
    path = folder / ABOUT_NAME
    if not path.exists():
        return About()
    try:
        return msgspec.convert(decode_json(require_inside(folder, path).read_bytes(), _CURE), About)
    except (OSError, ValueError) as error:
        raise ReportError(f"Cannot read {path}: {error}. {_CURE}") from error
