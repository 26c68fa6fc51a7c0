"""Damages runs, and gives what still decodes to every command that reads a run.

``python -m tests.scripts.fuzz_runs out`` damages 100,000 lines, begins where it stopped, and prints a table;
``--count`` says how many. Each line is sound but for some damage (``mutations.py``): a record, a line that
says why the run stopped, or the first line. It is decoded. What decodes is diagnosed, and takes the place of
the sound line in a run of 400 pairs, of which reports, pages, exports, comparisons, gates and lists are made:
the report and the page of every run, the others in turn. A run that fails is divided until the
line is known for which it does, and that line is kept in ``out``.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import io
import json
import logging
import pickle
import random
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import cycle, islice
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import Json, canonical_digest
from pytest_libero_max.cli import main as libero_max
from pytest_libero_max.errors import LiberoMaxError, ReportError
from pytest_libero_max.films.recorded import chosen
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.diagnosis import diagnose
from pytest_libero_max.runs.agreement import Agreement, SamePlay
from pytest_libero_max.runs.media import FILM_SELECTIONS
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.query_times import recorded_latency
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import decode_line, read_pairs, read_to_resume
from tests.scripts.fuzz import TooLong, limited
from tests.scripts.mutations import ROOT, altered_value, damaged_bytes, damaged_tree, json_text

RUNS = (
    "smoke/expert",
    "monitors/stale_expert",
    "safety/expert",
    "beyond/compound-servo",
    "beyond/delay-expert",
    "beyond/instruction_switch-expert",
    "beyond/moving-stale_expert",
    "beyond/transient-servo",
    "genuine/lite/stale_expert",
    "learned/lite",
    "studies/cadence-servo",
    "studies/camera-strength",
    "studies/event-timing-servo",
    "studies/latency-servo",
    "studies/recovery-gated",
)
"""Published runs with everything that records hold, damaged in turn; their number shares no factor with
eight, so that everything is damaged in each."""

PAIRS = 400
ATTEMPTS = 4
"""Times that a record is damaged until it still decodes."""

TRIES = 20
"""The same for a first line, a stop and a policy, with each of which a run stands and falls."""

MOST_S = 120.0
"""Processor time of the commands that a run is given to; a sound one takes a few seconds."""

KINDS = ("record", "stop", "first line", "policy of all")
"""What is damaged in a run: many of its records, or one thing by which it stands and falls."""

_OF_EIGHT = (*KINDS, "record", "first line", "record", "first line")
_STOP = {"reason": "3 regressions", "rule": "first_regression", "at": 3}
_WORDS: tuple[Any, ...] = (
    "base",
    "dynamic",
    "stages",
    "motion",
    "errors:3",
    "anytime:0.05",
    "plus",
    [1, 2, 3],
)
"""Values that mean something in a record."""


class Refused(Exception):
    """There is no report of a run, for an error of this package."""


@dataclass
class Count:
    """Counts of damaged lines.

    Attributes:
        lines: Lines that were damaged.
        read: Those that decoded, and were reported with their run.
        refused: Those that were refused with an error of this package, alone or with their run.
        failed: Those that brought about anything else, by kind.
        commands: Times that each command was given a run.
        by_kind: Lines, and those read, by what was damaged.
        runs: Runs that were made of them.
    """

    lines: int = 0
    read: int = 0
    refused: int = 0
    failed: dict[str, int] = field(default_factory=dict)
    commands: dict[str, int] = field(default_factory=dict)
    by_kind: dict[str, list[int]] = field(default_factory=dict)
    runs: int = 0

    def add(self, kind: str, read: bool) -> None:
        """Count a line whose fate is known."""
        self.lines += 1
        self.read += read
        self.refused += not read
        counts = self.by_kind.setdefault(kind, [0, 0])
        counts[0] += 1
        counts[1] += read

    def table(self) -> str:
        """As tables for ``reports/faults.md``."""
        rows = [
            "| Damaged | Lines | Read and reported | Refused with our error |",
            "| --- | --- | --- | --- |",
        ]
        rows += [
            f"| {kind} | {lines:,} | {read:,} | {lines - read:,} |"
            for kind, (lines, read) in self.by_kind.items()
        ]
        rows.append(f"| all | {self.lines:,} | {self.read:,} | {self.refused:,} |")
        failed = sum(self.failed.values())
        given = ", ".join(f"`{name}` {times:,}" for name, times in self.commands.items())
        return "\n".join([*rows, "", f"Anything else: {failed:,}. Runs: {self.runs:,}. Commands: {given}."])


@dataclass
class Damaged:
    """Lines of a run of which some are damaged.

    Attributes:
        first: The first line.
        lines: The others.
        places: Indices of the damaged ones.
    """

    first: bytes
    lines: list[bytes]
    places: list[int]

    def only(self, places: Sequence[int], sound: Sequence[bytes]) -> Damaged:
        """The run with some of its damaged lines, and the sound ones in place of the others."""
        lines = [
            sound[place] if place in self.places and place not in places else line
            for place, line in enumerate(self.lines)
        ]
        return Damaged(self.first, lines, list(places))


@cache
def sound_run(name: str) -> tuple[Json, ...]:
    """The first line and the pairs of a published run, the same ones several times over."""
    content = gzip.decompress((ROOT / "reports" / name / "pairs.jsonl.gz").read_bytes())
    lines = [json.loads(line) for line in content.splitlines()]
    head, *rest = lines
    planned = {pair["case_id"]: pair for pair in head["planned"]}
    pairs, plan = [], []
    for number, line in enumerate(islice(cycle(line for line in rest if line["line"] == "pair"), PAIRS)):
        names = {name: f"{line[name]}~{number}" for name in ("case_id", "item_id")}
        pairs.append(line | names)
        plan.append(planned[line["case_id"]] | names)
    ids = sorted(line["case_id"] for line in pairs)
    provenance: Json = head["provenance"]
    selection = {**provenance["selection"], "chosen": PAIRS, "of": PAIRS, "digest": canonical_digest(ids)}
    return {**head, "planned": plan, "provenance": {**provenance, "selection": selection}}, *pairs


def write_run(folder: Path, first: bytes, lines: Sequence[bytes]) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "pairs.jsonl").write_bytes(b"\n".join([first, *lines]) + b"\n")
    return folder


# Commands.


def commands_of(run: Path, sound: Path, out: Path) -> dict[str, Callable[[], object]]:
    """What reads a run, by name.

    Args:
        run: The damaged run.
        sound: The run that it was.
        out: A folder to write to.
    """
    against = f"regressions_vs({sound}) <= 3"
    gates = [f"--gate={text}" for text in ("delta >= -50%", "stale_mean <= 3 by event", against)]
    two = (run, sound, "--restrict")
    words: dict[str, tuple[object, ...]] = {
        "report": ("report", run),
        "report --figures": ("report", run, "--figures", "--tables", "--badge", gates[0]),
        "compare": ("compare", *two, "--output", out / "compared"),
        "compare --tables": ("compare", *two, "--tables", out / "tables"),
        "compare --by-cell": ("compare", sound, run, "--by-cell"),
        "trend": ("compare", "--over-time", sound, run, "--csv", out / "t.csv", "--html", out / "t.html"),
        "recovery": ("lab", "recovery", *two),
        "gate": ("gate", run, *gates),
        "export every-eval-ever": ("report", run, "--export", f"every-eval-ever={out / 'every'}"),
        "runs": ("runs", run.parent),
        "watch": ("runs", "--follow", "--once", run, sound),
        "plan": ("plan", "time", run, "--workers", "4", "--servers", "1"),
        "power": ("plan", "pairs", "--run", run, "--change", "-0.1"),
        "merge": ("shards", "merge", "--output", out / "merged", run),
        "film": ("film", run),
    }
    commands: dict[str, Callable[[], object]] = {
        name: partial(run_command, list(map(str, arguments))) for name, arguments in words.items()
    }
    return commands | {
        "publish and index": lambda: run_commands(
            ["publish", "pack", str(run), str(out / "runs")],
            ["publish", "index", str(out / "runs"), "--output", str(out / "index.html")],
        ),
        "choice of films": lambda: _choose_films(run),
        "latency of the run": lambda: recorded_latency(run, 20),
        "resume": lambda: read_to_resume(run),
    }


def run_commands(*commands: list[str]) -> None:
    for arguments in commands:
        run_command(arguments)


def run_command(arguments: list[str]) -> None:
    """Run a command as ``libero-max`` does; what it prints is dropped.

    Raises:
        Exception: Anything that is no error of this package.
    """
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        libero_max(arguments)


def _choose_films(run: Path) -> None:
    for which in FILM_SELECTIONS:
        chosen(read_pairs(run), [], which)


class Reader:
    """Gives runs to commands.

    Args:
        folder: Of everything that is written.

    Attributes:
        last: Name of the last command.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._turn = folder, 0
        self.last = "decode"

    def read(self, name: str, damaged: Damaged, count: Count | None, which: Sequence[str] = ()) -> None:
        """Give a run to the report and to the next commands in turn, or to the named ones.

        Raises:
            Refused: The report was refused with an error of this package.
            Exception: Anything that is no error of this package.
        """
        run = write_run(self._folder / "run", damaged.first, damaged.lines)
        out = write_run(self._folder / "out", b"", [])
        commands = commands_of(run, self._sound(name), out)
        others = [command for command in commands if command != "report"]
        self._turn += not which
        for command in which or ("report", others[self._turn % len(others)]):
            self.last = command
            with contextlib.suppress(LiberoMaxError):
                commands[command]()
            if command == "report" and not (run / "report.json").exists():
                raise Refused
            if count is not None:
                count.commands[command] = count.commands.get(command, 0) + 1

    def _sound(self, name: str) -> Path:
        folder = self._folder / "sound" / name
        if not folder.exists():
            first, *pairs = sound_run(name)
            write_run(folder, json_text(first), list(map(json_text, pairs)))
        return folder


# Damage.


def drawn_run(number: int, seed: int) -> tuple[str, str, random.Random]:
    """The published run that is damaged, what of it, and where chance comes from."""
    draw = random.Random(f"run/{seed}/{number}")
    return RUNS[number % len(RUNS)], _OF_EIGHT[number % len(_OF_EIGHT)], draw


def damaged_line(line: Json, draw: random.Random) -> bytes:
    """A damaged line: mostly values of their own kind, or of any, sometimes bytes."""
    how = draw.random()
    if how < 0.1:
        return damaged_bytes(json_text(line), draw)
    path = _part_of(line, draw)
    holder = whole = pickle.loads(pickle.dumps(line))
    for key in path[:-1]:
        holder = holder[key]
    key, part = path[-1], holder[path[-1]]
    holder[key] = altered_value(part, draw) if how < 0.6 else damaged_tree(part, draw, _WORDS)
    return json_text(whole)


def _part_of(line: Json, draw: random.Random) -> tuple[Any, ...]:
    """The way to a part of a line: of a record mostly into its arms, for the rest is planned beforehand."""
    path: list[Any] = []
    value, depth = line, draw.choice((1, 3, 4, 5))
    while len(path) < depth and isinstance(value, dict) and value:
        keys = ["arms"] if "arms" in value and depth > 1 else list(value)
        path.append(draw.choice([*keys, *("probes",) * 4] if "probes" in value else keys))
        value = value[path[-1]]
    return tuple(path)


def failure_of(error: BaseException) -> str:
    frames = [
        frame for frame in traceback.extract_tb(error.__traceback__) if "pytest_libero_max" in frame.filename
    ]
    place = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"
    return f"{type(error).__name__} {place}: {str(error)[:120]}"


class Fuzzer:
    """Damages runs one after another.

    Args:
        folder: Of the counts, and of the lines that failed.
        scratch: Of the runs.
        seed: Of the damage.
    """

    def __init__(self, folder: Path, scratch: Path, seed: int) -> None:
        self._path, self._seed = folder / "runs.json", seed
        self._folder, self._scratch, self._reader = folder, scratch, Reader(scratch)
        self.count = Count(**json.loads(self._path.read_text())) if self._path.exists() else Count()

    def go_on(self, total: int) -> Count:
        """Damage lines until there were so many."""
        while self.count.lines < total:
            name, kind, draw = drawn_run(self.count.runs, self._seed)
            self._damage(name, kind, draw, total - self.count.lines)
            self.count.runs += 1
            self._path.write_text(json.dumps(vars(self.count)))
        return self.count

    def _damage(self, name: str, kind: str, draw: random.Random, most: int) -> None:
        first, *pairs = sound_run(name)
        sound = list(map(json_text, pairs))
        if kind == "record":
            self._read_all(name, kind, self._records(name, draw, most), sound)
            return
        some, head = sound[: draw.choice((2, 6, 30))], json_text(first)
        for _ in range(min(most, TRIES)):
            if kind == "stop":
                stop = damaged_line({"line": "stopped", **_STOP, "of": len(first["planned"])}, draw)
                damaged = Damaged(head, [*some, stop], [len(some)])
            elif kind == "first line":
                damaged = Damaged(damaged_line(first, draw), some, [-1])
            else:
                policy = damaged_tree(pairs[0]["policy"], draw, _WORDS)
                lines = [json_text({**pair, "policy": policy}) for pair in pairs[: len(some)]]
                damaged = Damaged(head, lines, [-1])
            if self._decodes(damaged):
                self._read_all(name, kind, damaged, sound)
                return
            self.count.add(kind, read=False)

    def _decodes(self, damaged: Damaged) -> bool:
        """True if a whole run can be read, or what is wrong with it is no error of this package."""
        try:
            read_pairs(write_run(self._scratch / "decoded", damaged.first, damaged.lines))
        except LiberoMaxError:
            return False
        except Exception:
            return True  # the commands will say which error
        return True

    def _records(self, name: str, draw: random.Random, most: int) -> Damaged:
        """A run whose records are damaged; those that are refused are counted, and sound in it."""
        first, *pairs = sound_run(name)
        head = decode_line(json_text(first))
        assert isinstance(head, Run)
        agreement, lines = Agreement(head), list(map(json_text, pairs))
        places: list[int] = []
        same_play = SamePlay()
        for record in map(decode_line, lines):
            same_play.add(record)  # type: ignore[arg-type]  # pairs
        for place, pair in enumerate(pairs):
            for _ in range(min(ATTEMPTS, most - len(places))):
                line = damaged_line(pair, draw).replace(b"\n", b" ")
                try:
                    _take_in(line, agreement, same_play)
                except LiberoMaxError:
                    self.count.add("record", read=False)
                    most -= 1
                except Exception as error:
                    self._keep("record", line, error)
                    most -= 1
                else:
                    lines[place] = line
                    places.append(place)
                    break
        return Damaged(json_text(first), lines, places)

    def _read_all(self, name: str, kind: str, damaged: Damaged, sound: Sequence[bytes]) -> None:
        """Give a run to commands, again without each line for which they fail."""
        while damaged.places:
            try:
                with limited():
                    signal.setitimer(signal.ITIMER_VIRTUAL, MOST_S)
                    self._reader.read(name, damaged, self.count)
            except (Exception, TooLong) as error:
                guilty = self._guilty(name, damaged, sound)
                if isinstance(error, Refused):
                    self.count.add(kind, read=False)
                else:
                    self._keep(kind, damaged.first if guilty < 0 else damaged.lines[guilty], error)
                damaged = damaged.only([place for place in damaged.places if place != guilty], sound)
            else:
                for _ in damaged.places:
                    self.count.add(kind, read=True)
                return

    def _guilty(self, name: str, damaged: Damaged, sound: Sequence[bytes]) -> int:
        """A place for which the command fails that failed last, found by halving."""
        places, command = damaged.places, self._reader.last
        while len(places) > 1:
            half = places[: len(places) // 2]
            places = half if self._fails(name, damaged.only(half, sound), command) else places[len(half) :]
        return places[0]

    def _fails(self, name: str, damaged: Damaged, command: str) -> bool:
        try:
            with limited():
                signal.setitimer(signal.ITIMER_VIRTUAL, MOST_S)
                self._reader.read(name, damaged, None, [command])
        except (Exception, TooLong):
            return True
        return False

    def _keep(self, kind: str, line: bytes, error: BaseException) -> None:
        """Count a failure, and keep the line if it is the first of its kind."""
        failure = failure_of(error)
        short = " ".join(failure.split(" ")[:2])
        if short not in self.count.failed:
            (self._folder / f"{len(self.count.failed)}.input").write_bytes(line)
            print(f"{len(self.count.failed)}: {kind}, {self._reader.last}: {failure}", flush=True)
        self.count.failed[short] = self.count.failed.get(short, 0) + 1
        self.count.lines += 1


def _take_in(line: bytes, agreement: Agreement, same_play: SamePlay) -> None:
    """Decode a line that is a pair of its run, and diagnose its arms.

    Raises:
        LiberoMaxError: It is refused.
    """
    pair = decode_line(line)
    if isinstance(pair, Run | Stopped):
        raise ReportError("This is no pair.")
    if isinstance(pair, PairRecord):
        same_play.add(pair)  # with the sound ones behind it as well
    agreement.add(pair, "here")
    if isinstance(pair, PairRecord):
        for arm in pair.arms:
            diagnose(pair, arm)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, nargs="?", default=Path("fuzz"))
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    logging.disable()
    warnings.filterwarnings("error", category=RuntimeWarning)  # an overflow is printed as a number
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as scratch:
        count = Fuzzer(given.folder, Path(scratch), given.seed).go_on(given.count)
    print(f"\n{count.table()}")
    return 1 if count.failed else 0


if __name__ == "__main__":
    sys.exit(main())
