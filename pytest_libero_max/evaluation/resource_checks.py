"""Check of the memory before a run."""

from __future__ import annotations

from pytest_libero_max.errors import counted
from pytest_libero_max.machine import GIB, available_bytes
from pytest_libero_max.substrates.contract import SubstrateKind


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
