"""Origin of a run, as rows of a page: time, duration, policy, machine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.runs.provenance import commit_text
from pytest_libero_max.runs.query_times import query_times
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.worlds.rendering.context import DEVICE, renderers

_NOT_RECORDED = "not recorded"


def origin_rows(report: Report, stored: StoredRun) -> Iterator[tuple[str, str]]:
    """Yield names and values. Values that an older version did not record are marked so."""
    origin = report.provenance
    yield "date", origin.get("started") or _NOT_RECORDED
    yield "time in pairs", _duration(stored)
    policy = report.policy
    if policy is not None:
        yield "policy", f"{policy['name']}, revision {policy.get('revision') or _NOT_RECORDED}"
        yield "actions", f"horizon {policy['horizon']}, a query after {policy['query_interval']}"
    yield "named as", origin["policy"]["reference"]
    if origin["policy"].get("profile"):
        yield "profile", origin["policy"]["profile"]
    yield from _servers(stored)
    times = query_times_text(stored.records)
    if times is not None:
        yield "query times", times
    machine = [
        f"{value} cores" if name == "cores" else str(value)
        for name, value in origin["platform"].items()
        if value
    ]
    found = {
        f"{name} {record.fingerprints[name]}"
        for record in stored.records
        for name in (DEVICE, "blas")
        if record.fingerprints.get(name)
    }
    yield "machine", ", ".join([*machine, *sorted(found)]) or _NOT_RECORDED
    drawn = renderers(record.fingerprints for record in stored.records)
    if drawn:
        yield "images drawn by", _counted(drawn, "; ") if len(drawn) > 1 else next(iter(drawn))
    git = origin.get("git")
    if git:
        yield "repository", commit_text(git)


def query_times_text(records: Iterable[PairRecord]) -> str | None:
    """Return median and 95th percentile of the times of queries, by arm; None where no record has them."""
    parts = [
        f"{arm.capitalize()} p50 {_percentile(times, 0.5):g} ms, p95 {_percentile(times, 0.95):g} ms "
        f"({times.total():,} queries)"
        for arm, times in query_times(records).items()
    ]
    return "; ".join(parts) or None


def _percentile(times: Counter[float], share: float) -> float:
    """Return the smallest time that this share of the queries did not exceed."""
    seen, wanted = 0, share * times.total()
    for value, number in sorted(times.items()):
        seen += number
        if seen >= wanted:
            return value
    return max(times)


def _servers(stored: StoredRun) -> Iterator[tuple[str, str]]:
    answered = Counter(name for record in stored.records if (name := record.timings.get("server")))
    if len(answered) > 1:
        yield "servers", _counted(answered, ", ")


def _counted(pairs: Counter[str], separator: str) -> str:
    return separator.join(f"{name} ({counted(number, 'pair')})" for name, number in sorted(pairs.items()))


def _duration(stored: StoredRun) -> str:
    """Return the sum of the pairs' times, which exceeds the duration where several workers played."""
    seconds = sum(
        value
        for record in stored.records
        for name, value in record.timings.items()
        if name == "prefix_s" or name.startswith("arm_")
    )
    if not seconds:
        return _NOT_RECORDED
    minutes, rest = divmod(round(seconds), 60)
    spelled = f"{minutes} min {rest} s" if minutes else f"{rest} s"
    return f"{spelled} of {counted(len(stored.records), 'pair')}, workers added up"
