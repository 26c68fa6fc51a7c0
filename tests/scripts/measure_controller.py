"""Processor time of the process that owns a run, for each pair that its workers send; a plugin of pytest.

``python -m tests.scripts.measure_controller 2000 > pairs.json`` writes a manifest of so many pairs of the
``tiny`` substrate. With this folder in ``PYTHONPATH``, ``pytest -p measure_controller -n 8
--libero-max-policy=noop --libero-max-substrate=tiny --libero-max-manifest=pairs.json`` plays it: each worker
plays one pair of a variant, and then answers at once with its record under the other names. At the end
the controller prints its time from the first report to the last, and its memory.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Generator
from dataclasses import replace

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.plugin import run_pair
from pytest_libero_max.plugin.processes.pair_process import PairProcess

_play, _records = run_pair.play, dict[int, PairRecord]()
_seen: list[tuple[float, float]] = []


def answer_at_once(request: pytest.FixtureRequest, case: Case, process: PairProcess) -> PairRecord:
    """Return the record of the first pair of the same variant under the name of this one."""
    variant = case.event.variant
    if variant not in _records:
        _records[variant] = _play(request, replace(case, init_state_index=0), process)
    return structs.replace(
        _records[variant],
        case_id=case.case_id,
        item_id=case.item_id,
        case_digest=case.digest,
        init_state_index=case.init_state_index,
        policy_seed=case.policy_seed,
    )


run_pair.play = answer_at_once


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_logreport(report: pytest.TestReport) -> Generator[None]:
    """Note the time before the first report of a pair and after each last one."""
    if not _seen:
        _seen.append((time.process_time(), time.perf_counter()))
    yield
    if report.when == "call":
        _seen.append((time.process_time(), time.perf_counter()))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the time of a pair; with xdist, in the controller alone."""
    pairs = len(_seen) - 1
    cpu_ms, wall_ms = ((last - first) / pairs * 1e3 for first, last in zip(_seen[0], _seen[-1], strict=True))
    most_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    terminalreporter.write_line(
        f"{pairs} pairs, each {cpu_ms:.2f} ms of processor time in {wall_ms:.1f} ms; "
        f"the first report after {_seen[0][0]:.1f} s of processor time; {most_mib:.0f} MiB, report included"
    )


if __name__ == "__main__":
    from tests.plugin.conftest import tiny_manifest

    count = int(sys.argv[1])
    json.dump(tiny_manifest(tuple(range(count // 2)), ("illumination_switch",)), sys.stdout)
