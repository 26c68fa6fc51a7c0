"""``pairs.jsonl``: the durable record of a run, from which every reported number can be recomputed.

The first line is the run (``"line": "run"``: provenance and the planned pairs), every other line a measured
pair (``"line": "pair"``) or a pair that could not be measured (``"line": "error"``). Only the controller
writes it, a line at a time, and a line is on the disk before the next pair is dealt with.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import Json, canonical_digest, cut_torn_line, read_content
from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.run import Run

PAIRS_NAME = "pairs.jsonl"
PACKED_PAIRS_NAME = f"{PAIRS_NAME}.gz"
"""The same file in a published run; it is read, never written to."""


@dataclass(frozen=True)
class StoredRun:
    """A ``pairs.jsonl`` as read.

    Attributes:
        run: The plan and provenance of its first line.
        records: Measured pairs in the order of the file.
        errors: Pairs that could not be measured, in the order of the file. A case played again after an
            error has both; its record counts.
        torn: Whether the last line was cut off by a kill and has been left out.
    """

    run: Run
    records: tuple[PairRecord, ...]
    errors: tuple[PairError, ...]
    torn: bool

    @property
    def measured(self) -> frozenset[str]:
        """Ids of the cases that need not be played again."""
        return frozenset(record.case_id for record in self.records)


class PairStore:
    """Appends pairs to ``pairs.jsonl``; opens it with the first one.

    The file of an earlier run is set aside as ``pairs.1.jsonl``, ``pairs.2.jsonl``, ... and never written
    over.

    Args:
        folder: Output folder; made if missing.
        run: What the first line says.

    Raises:
        OptionError: The folder cannot be written to. Found here, before anything is played.
    """

    def __init__(self, folder: Path, run: Run) -> None:
        self.path = folder / PAIRS_NAME
        self._run = run
        self._file: FileIO | None = None
        self._append_to_existing = False
        self._broken = False
        require_writable(folder)

    @classmethod
    def resume(cls, folder: Path, run: Run) -> tuple[PairStore, StoredRun | None]:
        """Continue the run in ``folder``, or begin it where there is none.

        A torn last line is removed from the file.

        Returns:
            The store and what it already holds, None for a new run.

        Raises:
            ReportError: The folder holds a run of other cases or of another policy.
            OptionError: The folder cannot be written to.
        """
        store = cls(folder, run)
        if not store.path.exists() or b"\n" not in store.path.read_bytes():
            return store, None
        stored = read_pairs(store.path)
        _require_same_run(stored.run, run, store.path)
        if stored.torn:
            cut_torn_line(store.path)
        store._append_to_existing = True
        return store, stored

    def append(self, pair: PairRecord | PairError) -> None:
        """Write one pair and wait until the disk has it.

        Raises:
            ReportError: The file cannot be written any more, or the pair holds what JSON does not know.
        """
        kind = "pair" if isinstance(pair, PairRecord) else "error"
        self._write(kind, pair.to_dict())

    def close(self) -> None:
        """Finish the file; a run without a pair still gets its first line."""
        if self._file is None:
            self._open()
        assert self._file is not None
        self._file.close()
        self._file = None
        self._append_to_existing = True

    def _open(self) -> None:
        try:
            if self._append_to_existing:
                self._file = self.path.open("ab", buffering=0)
                return
            _set_aside(self.path)
            self._file = self.path.open("wb", buffering=0)
        except OSError as error:
            raise ReportError(
                f"Cannot write {self.path}: {error}. Give a folder you can write to."
            ) from error
        self._write("run", self._run.to_dict())

    def _write(self, kind: str, values: Json) -> None:
        if self._file is None:
            self._open()
        assert self._file is not None
        try:
            line = json.dumps({"line": kind, **values}, separators=(",", ":"), allow_nan=False) + "\n"
        except (TypeError, ValueError) as error:
            raise ReportError(
                f"case_id={values.get('case_id')!r} holds a value JSON does not know ({error}); what leaves "
                "a worker are finite numbers, text, lists and objects."
            ) from error
        if self._broken:
            raise ReportError(
                f"Cannot write {self.path}: an earlier write failed, and a line behind it could not be read. "
                "Make room and resume."
            )
        data = line.encode()
        try:
            if self._file.write(data) != len(data):
                raise OSError("only a part of the line was written")
            os.fsync(self._file.fileno())
        except OSError as error:
            self._broken = True
            raise ReportError(f"Cannot write {self.path}: {error}. Is the disk full?") from error


def _set_aside(path: Path) -> None:
    if path.exists():
        numbers = (int(name.stem.partition(".")[2]) for name in path.parent.glob("pairs.[0-9]*.jsonl"))
        path.replace(path.with_name(f"pairs.{max(numbers, default=0) + 1}.jsonl"))


def pairs_file(path: Path) -> Path:
    """The pairs of a run: those in a folder, packed where only these are there, or the file itself."""
    if not path.is_dir():
        return path
    plain, packed = path / PAIRS_NAME, path / PACKED_PAIRS_NAME
    return packed if packed.exists() and not plain.exists() else plain


def read_pairs(path: Path) -> StoredRun:
    """Read a ``pairs.jsonl`` or ``pairs.jsonl.gz`` (or the one in a folder).

    A last line without its line end was torn by a kill: it is left out, and ``torn`` says so. Damage
    anywhere else is an error.

    Raises:
        ReportError: The file is missing, or a line is damaged; names the line.
    """
    path = pairs_file(path)
    try:
        content = read_content(path)
    except OSError as error:
        raise ReportError(
            f"Cannot read {path}: {error}. Give a folder in which a run has written {PAIRS_NAME}."
        ) from error
    *lines, rest = content.split(b"\n")
    if not lines:
        raise ReportError(f"{path} holds no complete line: its run ended before the first pair.")
    run: Run | None = None
    records: list[PairRecord] = []
    errors: list[PairError] = []
    for number, line in enumerate(lines, start=1):
        where = f"{path}, line {number}"
        kind, values = _decode(line, where)
        if (kind == "run") != (number == 1):
            raise ReportError(
                f"{where}: line={kind!r}, but the run is the first line and the first line only."
            )
        try:
            if kind == "run":
                run = Run.from_dict(values)
            elif kind == "pair":
                records.append(PairRecord.from_dict(values))
            else:
                errors.append(PairError.from_dict(values))
        except ReportError as error:
            raise ReportError(f"{where}: {error}") from error
    assert run is not None
    return StoredRun(run, tuple(records), tuple(errors), torn=bool(rest))


def _decode(line: bytes, where: str) -> tuple[str, Json]:
    try:
        values: Any = json.loads(line)
    except ValueError as error:
        raise ReportError(
            f"{where}: not JSON ({error}). The file is damaged; remove that line to leave the pair out."
        ) from error
    kind = values.pop("line", None) if isinstance(values, dict) else None
    if kind not in ("run", "pair", "error"):
        raise ReportError(f"{where}: line={kind!r}, but must be 'run', 'pair' or 'error'.")
    return kind, values


def _require_same_run(stored: Run, wanted: Run, path: Path) -> None:
    if canonical_digest(stored.to_dict()["planned"]) != canonical_digest(wanted.to_dict()["planned"]):
        raise ReportError(
            f"{path} was planned with other cases ({len(stored.planned)} then, {len(wanted.planned)} now). "
            "Resume with the same track, manifest and selection, or choose another output folder."
        )
    for key in ("policy", "substrate", "protocol"):
        if stored.provenance.get(key) != wanted.provenance.get(key):
            raise ReportError(
                f"{path} was played with {key}={stored.provenance.get(key)!r}, now it is "
                f"{wanted.provenance.get(key)!r}. Resume with the same, or choose another output folder."
            )


def require_writable(folder: Path) -> None:
    """Make the folder if it is missing and try to write to it.

    Raises:
        OptionError: It cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-probe"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise OptionError(
            f"Output folder {str(folder)!r} cannot be written to: {error}. Give a folder you can write to."
        ) from error
