"""Damaged lines of ``pairs.jsonl`` are moved to a file beside it, and their pairs are played again.

A failing disk, an interrupted copy or an editor can damage a line. The other lines stay valid.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeAlias

from pytest_libero_max.errors import counted

DAMAGED_NAME = "pairs.damaged"
"""File of damaged lines, byte for byte, in the order in which they were found."""

_MOST_SAID = 3


@dataclass(frozen=True)
class DamagedLine:
    """A line that cannot be used."""

    number: int
    why: str

    def __str__(self) -> str:
        return f"line {self.number}: {self.why}"


FileState: TypeAlias = tuple[int, int, int]
"""Inode, size and time of the last write, ns: equal if a file was not altered."""


def file_state(path: Path) -> FileState | None:
    """Return the present state of a file; None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def damage_said(damaged: Collection[DamagedLine]) -> list[str]:
    """Return the messages of a resumed run about damaged lines."""
    if not damaged:
        return []
    count = counted(len(damaged), "damaged line")
    some = "; ".join(str(line) for line in list(damaged)[:_MOST_SAID])
    more = f"; and {len(damaged) - _MOST_SAID} more" if len(damaged) > _MOST_SAID else ""
    return [
        f"{count} of the pairs measured before, kept in {DAMAGED_NAME}; what is missing now is played again: "
        f"{some}{more}"
    ]


def set_lines_aside(path: Path, numbers: Collection[int]) -> None:
    """Move lines, and a last line without its end, from a file to the end of ``pairs.damaged`` beside it.

    At every moment of it each line is on the disk, in one of the files or in both.
    """
    *lines, torn = path.read_bytes().split(b"\n")
    aside = [line for number, line in enumerate(lines, start=1) if number in numbers]
    repaired = path.with_name(f"{path.name}.repaired")
    try:
        with repaired.open("wb") as file:
            _write(file, [line for number, line in enumerate(lines, start=1) if number not in numbers])
        with path.with_name(DAMAGED_NAME).open("ab") as file:
            _write(file, [*aside, *([torn] if torn else [])])
    except OSError:
        repaired.unlink()
        raise
    repaired.replace(path)


def _write(file: BinaryIO, lines: Iterable[bytes]) -> None:
    file.writelines(line + b"\n" for line in lines)
    file.flush()
    os.fsync(file.fileno())
