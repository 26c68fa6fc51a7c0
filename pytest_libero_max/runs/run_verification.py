"""Pairs of a run played again at its end, each by a session of its own, in fresh processes."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.replay_command import OUTPUT, replay_command
from pytest_libero_max.runs.store import StoredRun, read_pairs
from pytest_libero_max.worlds.rendering.context import drawn_by

if TYPE_CHECKING:
    from pytest_libero_max.pairing.record import PairRecord

TITLE = "Pairs played again"

_ALONE = (
    *("-q", "-p", "no:cacheprovider"),
    *("--libero-max-verify=0", "--libero-max-film=none", "--libero-max-progress=none"),
)
"""Options of a session that plays one pair, whatever the ini file says."""


def verified(
    run: StoredRun, number: int, folder: Path, *, seed: str = "", policy: str | None = None
) -> dict[str, str]:
    """Play pairs of a run again, and compare how their arms end.

    A policy that keeps something from pair to pair, and whatever else in a process outlives a pair, is the
    same each time that this process asks it. A process that has played nothing else has none of it. The
    policy behind a server is asked where it was.

    Args:
        run: The run.
        number: Number of pairs; by turns of each suite.
        folder: Folder in which the run was started, or where its policy is found.
        seed: Other pairs are drawn by each.
        policy: Reference of the policy here; by default that of the run.

    Returns:
        By item id of each pair: empty if outcome, steps and proof of each arm are the same, otherwise what
        differs, or why it could not be played.
    """
    command = [sys.executable, "-m", *replay_command(run)[:-1], *_ALONE]
    command.remove(f"--libero-max-output={OUTPUT}")
    if policy is not None:
        command.append(f"--libero-max-policy={policy}")  # pytest takes the last
    return {record.item_id: _again(record, command, folder) for record in chosen(run.records, number, seed)}


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


def _again(record: PairRecord, command: Sequence[str], folder: Path) -> str:
    with tempfile.TemporaryDirectory(prefix="libero-max-") as name:
        output = Path(name, "run")
        own = ["-k", record.item_id, f"--libero-max-output={output}"]
        done = subprocess.run(
            [*command, *own],
            cwd=folder,
            env=os.environ,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            check=False,
        )
        try:
            (again,) = read_pairs(output).records
        except (ReportError, OSError, ValueError):
            lines = done.stdout.decode(errors="replace").strip().splitlines()
            return f"could not be played ({lines[-1] if lines else f'exit status {done.returncode}'})"
    return _differences(record, again)


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
    found: dict[str, str], seconds: float, how: str = "in processes of their own"
) -> tuple[list[str], list[str]]:
    """Return lines of the summary, and problems of the run.

    Args:
        found: Result of :func:`verified`.
        seconds: Time that it took.
        how: The way in which they were played.
    """
    other = {item: text for item, text in found.items() if text}
    alike = f"{len(found) - len(other)} of {len(found)} pairs"
    lines = [f"Played again: {alike} end alike {how}, with proofs ({seconds:.0f} s)."]
    if not other:
        return lines, []
    problem = (
        f"NOT REPEATED: {len(other)} of {len(found)} pairs came out otherwise {how}, so that results depend "
        "on what was played before, or cannot be repeated here: "
    )
    return lines, [problem + ", ".join(f"{item} ({text})" for item, text in other.items())]
