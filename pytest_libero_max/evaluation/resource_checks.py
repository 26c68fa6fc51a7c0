"""Checks of disk and memory before a run."""

from __future__ import annotations

from pathlib import Path

from pytest_libero_max.errors import DiskError, counted
from pytest_libero_max.machine import GIB, available_bytes, free_disk_bytes
from pytest_libero_max.substrates.contract import SubstrateKind

MIB = 2**20
_PAIR_BYTES = 10_000
"""Disk space of a pair in ``pairs.jsonl`` and the reports: more than twice that of the reference policies."""

_REPORT_BYTES = 32 * MIB
"""Disk space of the reports and their figures, whatever the number of pairs."""


def require_disk_space(output: Path, pairs: int) -> None:
    """Refuse a run whose records do not fit on the disk; traces and films are not counted.

    Raises:
        DiskError: There is too little; says how much there is, and how much is needed.
    """
    free, needed = free_disk_bytes(output), _REPORT_BYTES + pairs * _PAIR_BYTES
    if free is not None and free < needed:
        raise DiskError(
            f"{free / MIB:.0f} MiB are free for {str(output)!r}, but the records and reports of "
            f"{counted(pairs, 'pair')} take up to {needed / MIB:.0f} MiB. Make room, or give another "
            "--libero-max-output."
        )


def memory_note(workers: int, kind: SubstrateKind) -> str | None:
    """Return a warning where memory is too little for the workers; None where it is enough or unknown."""
    available, each = available_bytes(), int(kind.worker_gib * GIB)
    if available is None or available >= workers * each:
        return None
    fits = max(available // each, 1)
    return (
        f"libero-max: {available / GIB:.1f} GiB of memory are free, and {counted(workers, 'worker')} would "
        f"take about {workers * each / GIB:.1f} GiB on the {kind.name} substrate, without the policy. "
        f"Play with -n {fits}, or serve the policy once for all workers (libero-max serve)."
    )
