"""Pairs of a run played again at its end, each by a session of its own, in fresh processes."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.programs import program_of_run
from pytest_libero_max.errors import ReportError, counted
from pytest_libero_max.machine import WEIGHTS
from pytest_libero_max.runs.fresh_place import fresh_place
from pytest_libero_max.runs.replay_command import OUTPUT, Places, replay_command
from pytest_libero_max.runs.store import StoredRun, read_pairs
from pytest_libero_max.worlds.rendering.context import drawn_by

if TYPE_CHECKING:
    from pytest_libero_max.pairing.record import PairRecord

TITLE = "Pairs played again"

CANNOT_JUDGE = (
    "Played again: no pair. The policy is not repeatable, so a pair that ends otherwise would show nothing: "
    "whether it keeps something from pair to pair cannot be judged."
)

_ALONE = (
    *("-q", "-p", "no:cacheprovider"),
    *("--libero-max-verify=0", "--libero-max-film=none", "--libero-max-progress=none"),
)
"""Options of a session that plays one pair, whatever the ini file says."""

FRESH = "in processes and folders of their own"
"""Way in which pairs are played again by asking their policy."""


def verified(
    run: StoredRun, number: int, places: Places, folder: Path | None = None, *, seed: str = ""
) -> dict[str, str]:
    """Play pairs of a run again, and compare how their arms end.

    A policy that keeps something from pair to pair, and whatever else in a process outlives a pair, is the
    same each time that this process asks it. A process that has played nothing else has none of it. Home,
    cache, temporary and working folder are new, so that it finds nothing there that the run has left either.
    The policy behind a server is asked where it was.

    Args:
        folder: Folder in which the run was started, whose ini and conftest files count. None: no modules, ini
            or conftest files are taken from a working folder, which somebody else may have written.
        seed: Other pairs are drawn by each.

    Returns:
        By item id of each pair: empty if outcome, steps and proof of each arm are the same, otherwise what
        differs, or why it could not be played.
    """
    return {
        record.item_id: _again(run, record, places, folder) for record in chosen(run.records, number, seed)
    }


def chosen(records: Sequence[PairRecord], number: int, seed: str = "") -> list[PairRecord]:
    """Return so many pairs, by turns of each suite; the same for the same records and seed in any order."""
    ranked = sorted(records, key=lambda record: hashlib.sha256(f"{seed}{record.case_id}".encode()).digest())
    before: Counter[str] = Counter()
    turns = []
    for record in ranked:
        turns.append((before[record.suite], record.suite))
        before[record.suite] += 1
    order = sorted(range(len(ranked)), key=turns.__getitem__)
    return [ranked[place] for place in order[:number]]


def _again(run: StoredRun, record: PairRecord, places: Places, folder: Path | None) -> str:
    with fresh_place() as (working, environment):
        output = working.with_name("run")
        command = [sys.executable, "-m", *_command(run, places, working), *_ALONE]
        command += ["-k", record.item_id, f"--libero-max-output={output}"]
        if folder is None:
            empty = working / "pytest.ini"
            empty.write_text("[pytest]\n", encoding="utf-8")
            command[1:1] = ["-P"]
            command += ["-c", str(empty), f"--rootdir={working}"]
        done = subprocess.run(
            command,
            cwd=working if folder is None else folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            check=False,
        )
        try:
            (again,) = read_pairs(output).records
        except (ReportError, OSError, ValueError):
            return f"could not be played ({_reason(output, done)})"
    return _differences(record, again)


def _command(run: StoredRun, places: Places, working: Path) -> list[str]:
    """Return the command that plays a pair of the run, with program and study of its header in files."""
    protocol = run.run.provenance["protocol"]
    program, study = program_of_run(protocol), (protocol.get("study") or {}).get("document")
    for name, document in (("program", program and program.to_dict()), ("study", study)):
        if document is not None:
            file = working.with_name(f"{name}.json")
            file.write_text(json.dumps(document), encoding="utf-8")
            named: dict[str, Any] = {name: str(file)}
            places = replace(places, **named)
    command = replay_command(run, places)[:-1]
    command.remove(f"--libero-max-output={OUTPUT}")
    return command


def _reason(output: Path, done: subprocess.CompletedProcess[bytes]) -> str:
    """Return why a session has no record: its error, or the last line that it printed."""
    try:
        errors = read_pairs(output).errors
    except (ReportError, OSError, ValueError):
        errors = ()
    if errors:
        return f"{errors[-1].kind}: {errors[-1].message}"
    lines = done.stdout.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else f"exit status {done.returncode}"


def _differences(record: PairRecord, again: PairRecord) -> str:
    """Return what differs in the arms, and the renderers where these differ as well; empty for nothing."""
    different = [text for name in record.arms if (text := _difference(name, record, again))]
    then, now = drawn_by(record.fingerprints), drawn_by(again.fingerprints)
    if different and then and now and then != now:
        different.append(f"images drawn by {then} then, {now} here")
    return "; ".join(different)


def _difference(name: str, record: PairRecord, again: PairRecord) -> str:
    """Return what differs in an arm, for example ``dynamic: success True, then False``; empty for nothing."""
    first, second = record.arms[name], again.arms.get(name)
    if second is None:
        return f"{name}: not played"
    for field in ("success", "steps"):
        before, after = getattr(first, field), getattr(second, field)
        if before != after:
            return f"{name}: {field} {before}, then {after}"
    return "" if first.proof == second.proof else f"{name}: other proof"


def verification_lines(
    found: Mapping[str, str], seconds: float, how: str = FRESH
) -> tuple[list[str], list[str]]:
    """Return lines of the summary, and problems of the run."""
    other = {item: text for item, text in found.items() if text}
    alike = f"{len(found) - len(other)} of {counted(len(found), 'pair')}"
    lines = [f"Played again: {alike} alike {how}, with proofs ({seconds:.0f} s)."]
    if not other:
        return lines, []
    problem = (
        f"NOT REPEATED: {len(other)} of {counted(len(found), 'pair')} came out otherwise {how}, so that "
        "results depend on what was played before, or cannot be repeated here: "
    )
    problem += ", ".join(f"{item} ({text})" for item, text in other.items())
    if how == FRESH:
        problem += (
            ". There, home, cache, temporary and working folder are empty, but for the weights in "
            f"{', '.join(WEIGHTS)}: name other files that the policy needs by paths or by variables."
        )
    return lines, [problem]
