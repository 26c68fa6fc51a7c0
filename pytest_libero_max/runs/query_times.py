"""Times of the queries of a run, which its records count, and the latency of a policy that takes them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from pytest_libero_max.benchmark.latency import Latency, Runner
from pytest_libero_max.errors import ReportError, counted
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.record_rules import QUERY_MS
from pytest_libero_max.pairing.stage import WAITED
from pytest_libero_max.runs.store import read_pairs


def query_times(records: Iterable[PairRecord]) -> dict[str, Counter[float]]:
    """Return numbers of queries by their time, ms, for each arm of which the records have them."""
    counts: dict[str, Counter[float]] = {}
    for record in records:
        for arm, times in record.timings.get(QUERY_MS, {}).items():
            counts.setdefault(arm, Counter()).update({float(ms): int(number) for ms, number in times.items()})
    return counts


def recorded_latency(folder: Path, hz: int, runner: Runner = "async") -> Latency:
    """Return the latency whose delays are drawn from the query times of a run, in whole control steps.

    Pairs that waited for a server that had gone away are left out.

    Raises:
        ReportError: The run cannot be read, or no record of it has query times.
    """
    records = read_pairs(folder).records
    times = query_times(record for record in records if WAITED not in record.timings)
    total: Counter[float] = sum(times.values(), Counter())
    if not total:
        raise ReportError(
            f"{folder}: none of its {counted(len(records), 'pair')} says how long its queries took. Play a "
            "few pairs with the policy, with one worker, and name the folder of that run."
        )
    return Latency.of_times(total, hz, runner)
