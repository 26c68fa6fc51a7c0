"""``pairs.jsonl``: the durable record of a run, from which every reported number can be recomputed.

The first line is the run (``"line": "run"``: provenance and the planned pairs), every other line a measured
pair (``"line": "pair"``) or a pair that could not be measured (``"line": "error"``). A run that was stopped
ends with a line that says why (``"line": "stopped"``); pairs behind it are those of a resumed run. Only the
controller writes the file, a line at a time. The system has a line before the next pair is dealt with, so a
process that is killed loses none. A machine that fails may lose those that came within :data:`SYNC_S` of a
line that the disk has.
"""

from __future__ import annotations

import gc
import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import FileIO
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json, read_content
from pytest_libero_max.benchmark.order import SORTED_NAME
from pytest_libero_max.benchmark.structs import decode_json, shown
from pytest_libero_max.errors import DiskError, OptionError, OtherRunError, ReportError
from pytest_libero_max.pairing.record import RECORD_VERSION, PairError, PairRecord
from pytest_libero_max.runs.agreement import Agreement, policy_differences
from pytest_libero_max.runs.comparability import declare_weights, measurement_differences
from pytest_libero_max.runs.damaged_lines import (
    DAMAGED_NAME,
    DamagedLine,
    FileState,
    file_state,
    set_lines_aside,
)
from pytest_libero_max.runs.lock import Mark, require_ended, require_free
from pytest_libero_max.runs.media import kept_beside
from pytest_libero_max.runs.outside import require_inside
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.stopped import Stopped, ended_by_rule

PAIRS_NAME = "pairs.jsonl"
PACKED_PAIRS_NAME = f"{PAIRS_NAME}.gz"
"""The same file in a published run; it is read, never written to."""

SYNC_S = 0.5
"""Least time between two waits for the disk, s: on a network file system each costs as much as many lines."""

COMPUTED_NAMES = ("report.json", "report.md", "report.html", "badge.json")
"""Files that are computed from the pairs and lie beside them."""


@dataclass(frozen=True)
class StoredRun:
    """A ``pairs.jsonl`` as read."""

    run: Run
    records: tuple[PairRecord, ...]
    errors: tuple[PairError, ...]
    """Pairs that could not be measured, in the order of the file. A case played again after an error has
    both; its record counts."""
    torn: bool
    """True if the last line was cut off by a kill and has been left out."""
    damaged: tuple[DamagedLine, ...] = ()
    """Lines that no run writes, left out as well. Only a run that is to be resumed is read like this; to any
    other reader such a line is an error."""
    state: FileState | None = None
    """Of the file when it was read, where the run is to go on."""
    stopped: Stopped | None = None
    """Reason the run was stopped, if nothing was played after that."""

    @property
    def stopped_by_rule(self) -> bool:
        """True if a rule kept the run from its planned number of pairs, see :func:`.ended_by_rule`."""
        policy = self.records[0].policy if self.records else None
        return ended_by_rule(self.stopped, self.run.planned, policy, self.measured)

    @property
    def measured(self) -> frozenset[str]:
        """Ids of the cases that have a record."""
        return frozenset(record.case_id for record in self.records)

    @property
    def refused(self) -> tuple[PairError, ...]:
        """Pairs that were refused for what the policy did, in the order of the file."""
        measured = self.measured
        return tuple(error for error in self.errors if error.refused and error.case_id not in measured)

    @property
    def settled(self) -> frozenset[str]:
        """Ids of the cases that are not played again: measured, or refused."""
        return self.measured | {error.case_id for error in self.refused}


class PairStore:
    """Appends pairs to ``pairs.jsonl``.

    The run begins with the first pair, or with :meth:`begin`, and ends with :meth:`close`. In between the
    folder is marked as one whose run is in progress. The file of an earlier run is set aside as
    ``pairs.1.jsonl``, ``pairs.2.jsonl``, ... and never written over, and so are its traces and films
    (``traces.1``, ``films.1``); the reports of that run are removed.

    Raises:
        OptionError: The folder cannot be written to, or another run is in progress in it. Found here, before
            anything is played.
    """

    def __init__(self, folder: Path, run: Run) -> None:
        self.path = folder / PAIRS_NAME
        self.run = run
        self._file: FileIO | None = None
        self._mark: Mark | None = None
        self._agreement = Agreement(run)
        self._refused: dict[str, PairError] = {}  # by case id
        self._append_to_existing = False
        self._resumed: StoredRun | None = None
        self._broken: OSError | None = None
        self._synced = -SYNC_S  # time of the last wait for the disk, on the monotonic clock
        require_writable(folder)
        require_free(folder)

    @classmethod
    def resume(
        cls, folder: Path, run: Run, stored: StoredRun | None = None, policy: Json | None = None
    ) -> tuple[PairStore, StoredRun | None]:
        """Continue the run in ``folder``, or begin it where there is none.

        Damaged lines are taken out of the file when the run begins, and kept beside it; see
        :func:`.damaged_lines.set_lines_aside`.

        Args:
            policy: The policy's spec, where it is known before it plays.

        Returns:
            The store and what it already holds, None for a new run.

        Raises:
            ReportError: The folder holds a run of other cases, or of another policy, or one that was played
                with something else that changes results; names every difference. Or the first line is
                damaged, which says what the run is.
            OptionError: The folder cannot be written to, or another run is in progress in it.
        """
        store = cls(folder, run)
        stored = stored or read_to_resume(folder)
        if stored is None:
            return store, None
        _require_same_run(stored, run, store.path, policy)
        for record in stored.records:
            store._agreement.add(record, str(store.path))
        store._refused = {error.case_id: error for error in stored.refused}
        store._append_to_existing = True
        store._resumed = stored
        return store, stored

    def begin(self) -> None:
        """Mark the folder, set aside what an earlier run left there, and write the first line.

        Raises:
            OptionError: Another run is in progress in the folder, or has played there since this one looked.
            DiskError: The folder cannot be written to any more.
        """
        if self._mark is None:
            self._mark = Mark(self.path.parent)
        try:
            self._open()
        except BaseException:
            self.abandon()
            raise

    def abandon(self) -> None:
        """Let go of a folder in which nothing could be played: it is as if this run had not begun."""
        self._shut()
        if self._mark is not None:
            self._mark.abandon()
        self._mark = None

    def _open(self) -> None:
        try:
            if self._append_to_existing:
                self._repair()
                self._file = self.path.open("ab", buffering=0)
                return
            if self.path.exists():
                _set_aside(self.path)
                for name in COMPUTED_NAMES:
                    (self.path.parent / name).unlink(missing_ok=True)
            self._file = self.path.open("wb", buffering=0)
        except OSError as error:
            raise DiskError(
                f"Cannot write {self.path}: {error}. Make room, or give a folder you can write to."
            ) from error
        self._write_line(_line("run", self.run))

    def _repair(self) -> None:
        """Take damaged lines out of the file, which nobody else can have altered behind the lock."""
        stored = self._resumed
        if stored is None:
            return
        if file_state(self.path) != stored.state:
            raise OptionError(
                f"{self.path} was written by another run since this one looked. Give the command again."
            )
        if stored.damaged or stored.torn:
            set_lines_aside(self.path, {line.number for line in stored.damaged})
        self._resumed = None

    def append(self, pair: PairRecord | PairError) -> None:
        """Write one pair. The disk has it on return or, where it came soon after another, with a later one.

        Raises:
            DiskError: The file cannot be written any more.
            OtherRunError: The pair was played with something else than the run's other pairs.
            ReportError: The pair is not one of the run's, was measured or refused before, or holds what JSON
                does not know.
        """
        refused = self._refused.get(pair.case_id)
        if refused is not None:
            raise ReportError(
                f"case_id={pair.case_id!r} was refused before ({refused.kind}: {refused.message}) and stays "
                "refused, because a play that happens to pass is no measurement. Repair the policy and begin "
                "a new run."
            )
        line = _line("pair" if isinstance(pair, PairRecord) else "error", pair)
        self._agreement.add(pair, "now")
        self._write_line(line)
        if isinstance(pair, PairError) and pair.refused:
            self._refused[pair.case_id] = pair

    def note(self, progress: Json) -> None:
        """Note the progress for watchers of the folder; see :class:`.status.Follower`."""
        if self._mark is not None:
            self._mark.note(progress)

    def close(self, stopped: Stopped | None = None) -> None:
        """End the run; one without a pair still gets its first line; raises DiskError."""
        try:
            if self._file is None:
                self.begin()
            else:
                self._require_there()
            if stopped is not None:
                self._write_line(_line("stopped", stopped))
            if self._file is not None and self._broken is None:
                os.fsync(self._file.fileno())
        except OSError as error:
            raise DiskError(f"Cannot write {self.path}: {error}.") from error
        finally:
            self._shut()
            if self._mark is not None:
                self._mark.remove()
            self._mark = None
            self._append_to_existing = True

    def _shut(self) -> None:
        if self._file is not None:
            self._file.close()
        self._file = None

    def _write_line(self, line: bytes) -> None:
        if self._file is None:
            self.begin()
        assert self._file is not None
        if self._broken is not None:
            raise DiskError(
                f"Cannot write {self.path}: an earlier write failed ({self._broken}), and a line behind it "
                "could not be read. Make room and resume."
            )
        try:
            self._require_there()
            if self._file.write(line) != len(line):
                raise OSError("only a part of the line was written")
            if time.monotonic() - self._synced >= SYNC_S:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as error:
            self._broken = error
            raise DiskError(f"Cannot write {self.path}: {error}. Is the disk full?") from error

    def _require_there(self) -> None:
        """Refuse to write into a file that was removed, which would take every line and keep none."""
        if not self.path.exists():
            raise DiskError(
                f"Cannot write {self.path}: it was removed while the run wrote to it. Begin the run again."
            )


def _line(kind: str, value: Run | PairRecord | PairError | Stopped) -> bytes:
    try:
        values = {"line": kind, **value.to_dict()}
        text = json.dumps(values, separators=(",", ":"), allow_nan=False)
        if "\\ud" in text:  # half a character, as in a name that is no UTF-8, cannot be read again
            text = json.dumps(values, separators=(",", ":"), ensure_ascii=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise ReportError(
            f"case_id={getattr(value, 'case_id', None)!r} holds a value JSON does not know ({error}); what "
            "leaves a worker are finite numbers, text, lists and objects."
        ) from error
    return text.encode(errors="replace") + b"\n"


def _set_aside(path: Path) -> None:
    """Rename the pairs of an earlier run, and its traces and films, with the next number that is free."""
    folder = path.parent
    beside = kept_beside(folder)
    named = [
        *folder.glob("pairs.[0-9]*.jsonl"),
        *(old for name in beside for old in folder.glob(f"{name}.*")),
    ]
    numbers = [int(part) for old in named if (part := old.name.split(".")[1]).isdecimal()]
    number = max(numbers, default=0) + 1
    path.replace(path.with_name(f"pairs.{number}.jsonl"))
    damaged = path.with_name(DAMAGED_NAME)
    if damaged.exists():
        damaged.replace(path.with_name(f"pairs.{number}.damaged"))
    for name in beside:
        (folder / name).rename(folder / f"{name}.{number}")


def pairs_file(path: Path) -> Path:
    """Return the path of a run's pairs: the file itself, or that in the folder, which may be packed.

    Raises:
        ReportError: In the folder it is a link that leads out of it.
    """
    if not path.is_dir():
        return path
    plain, packed = path / PAIRS_NAME, path / PACKED_PAIRS_NAME
    return require_inside(path, packed if packed.exists() and not plain.exists() else plain)


def read_pairs(path: Path, *, ended: bool = True) -> StoredRun:
    """Read a ``pairs.jsonl`` or ``pairs.jsonl.gz`` (or the one in a folder), and check all that it says.

    A last line without its line end was torn by a kill: it is left out, and ``torn`` says so. Damage
    anywhere else is an error, and so are a value that a field cannot hold and values that contradict each
    other.

    Args:
        path: The file, or its folder.
        ended: True if the run must have ended. False: read the pairs of one that was stopped.

    Raises:
        ReportError: The file is missing, its run is in progress or was killed, or a line is damaged; names
            the line.
    """
    path = pairs_file(path)
    if ended and path.name == PAIRS_NAME:
        require_ended(path.parent)
    stored = _read(path)
    if stored.damaged:
        raise ReportError(f"{path}, {stored.damaged[0]} {_CURE}")
    return stored


_CURE = (
    "Give the command of the run again with --libero-max-resume: it sets the line aside and plays the pair "
    "again."
)


def _read(path: Path, cases: Mapping[str, Case] | None = None) -> StoredRun:
    """Read all valid lines."""
    with _collector_paused():
        return _decoded(path, cases)


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Pause Python's collector, which walks over all records again and again and finds nothing to free."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _decoded(path: Path, cases: Mapping[str, Case] | None) -> StoredRun:
    try:
        content = read_content(path)
    except (OSError, ValueError) as error:
        raise ReportError(
            f"Cannot read {path}: {error}. Give a folder in which a run has written {PAIRS_NAME}."
        ) from error
    *lines, rest = content.split(b"\n")
    if not lines:
        raise ReportError(f"{path} holds no complete line: its run ended before the first pair.")
    records: list[PairRecord] = []
    errors: list[PairError] = []
    damaged: list[DamagedLine] = []
    stopped: Stopped | None = None
    for number, line in enumerate(lines, start=1):
        try:
            value = decode_line(line)
            if isinstance(value, Run) != (number == 1):
                raise ReportError(
                    f"line={_kind_of(line)!r}, but the run is the first line and the first line only."
                )
            if isinstance(value, Run):
                run, agreement = value, Agreement(value, cases)
                continue
            if isinstance(value, Stopped):
                value.require_of(run)
                stopped = value
                continue
            agreement.add(value, f"line {number}")
        except OtherRunError as error:
            raise OtherRunError(f"{path}, line {number}: {error}") from error
        except ReportError as error:
            if number == 1:
                raise ReportError(
                    f"{path}, line 1: {error} The first line says what the run is, and the others mean "
                    "nothing without it: put it back from a copy, or choose another output folder."
                ) from error
            damaged.append(DamagedLine(number, str(error)))
            continue
        stopped = None
        if isinstance(value, PairRecord):
            records.append(value)
        else:
            errors.append(value)
    return StoredRun(
        run, tuple(records), tuple(errors), torn=bool(rest), damaged=tuple(damaged), stopped=stopped
    )


def read_to_resume(folder: Path, cases: Mapping[str, Case] | None = None) -> StoredRun | None:
    """Read a run that may be resumed; None where the folder holds not even the whole first line.

    Args:
        cases: The cases of its manifest by id: a record that contradicts its case is a damaged line.

    Raises:
        ReportError: The first line is damaged, or another line is of another run; names the line.
    """
    path = folder / PAIRS_NAME
    state = file_state(path)
    if state is None:
        return None
    with path.open("rb") as file:
        begun = file.readline().endswith(b"\n")
    return replace(_read(path, cases), state=state) if begun else None


class _Head(Struct):
    """The fields that say how to read a line."""

    line: Any = None
    schema_version: Any = None


_HEAD = msgspec.json.Decoder(_Head)


def decode_line(line: bytes) -> Run | PairRecord | PairError | Stopped:
    """Decode a line, or raise ReportError."""
    try:
        head = _HEAD.decode(line)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        values = decode_json(line, "The line is damaged.")
        raise ReportError(f"The line must be an object, but this is {shown(values)}.") from None
    if head.line not in ("run", "pair", "error", "stopped"):
        raise ReportError(f"line={shown(head.line)}, but must be 'run', 'pair', 'error' or 'stopped'.")
    if head.line == "pair" and head.schema_version == RECORD_VERSION:
        return PairRecord.from_json(line)
    values = decode_json(line, "The line is damaged.")
    del values["line"]
    if head.line == "run":
        return Run.from_dict(values)
    if head.line == "stopped":
        return Stopped.from_dict(values)
    return PairRecord.from_dict(values) if head.line == "pair" else PairError.from_dict(values)


def _kind_of(line: bytes) -> object:
    return _HEAD.decode(line).line


def _require_same_run(stored: StoredRun, wanted: Run, path: Path, policy: Json | None) -> None:
    before = stored.run
    then, now = (run.provenance.get("order", SORTED_NAME) for run in (before, wanted))
    if then != now:
        raise ReportError(
            f"{path} was begun in the order {then}, and now the order is {now}. Resume with "
            f"--libero-max-order={then}, or choose another output folder."
        )
    if {pair.case_id: pair for pair in before.planned} != {pair.case_id: pair for pair in wanted.planned}:
        raise ReportError(
            f"{path} was planned with other cases ({len(before.planned)} then, {len(wanted.planned)} now). "
            "Resume with the same track, manifest, program and selection, or choose another output folder."
        )
    different = measurement_differences(before, wanted, declared=declare_weights(stored.records))
    if not different and policy is not None and stored.records:
        different = policy_differences(stored.records[0].policy, policy)
    if different:
        raise ReportError(
            f"{path} was played with something else than now (then, now): {'; '.join(different)}. Resume "
            "with the same, or choose another output folder."
        )


def require_writable(folder: Path) -> None:
    """Make the folder if it is missing and try to write to it, or raise OptionError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-probe"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise OptionError(
            f"Output folder {str(folder)!r} cannot be written to: {error}. Give a folder you can write to."
        ) from error
