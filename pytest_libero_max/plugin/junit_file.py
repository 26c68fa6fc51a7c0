"""What a JUnit file holds beside the pairs: properties of its suite, and a test case for each gate."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal

import pytest

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.plugin.collection import PSEUDO_PATH

if TYPE_CHECKING:
    from pytest_libero_max.report.gates import GateResult


def gate_case(text: str, result: GateResult | None, replay: Sequence[str] | None = None) -> pytest.TestReport:
    """Return the test case of a gate: failed where it does not hold, skipped where nothing was decided.

    Args:
        result: Its verdict; None where this run does not decide it.
    """
    from pytest_libero_max.report.gate_text import gate_lines

    outcome: Literal["passed", "failed", "skipped"] = "skipped"
    said = f"{text}: not decided by this run; that of a shard is decided by libero-max shards merge."
    if result is not None:
        if result.verdict != "undecidable" and not result.no_baseline:
            outcome = result.verdict
        said = "\n".join(gate_lines([result], replay))
    place = (PSEUDO_PATH, 0, f"gate[{text}]")
    return pytest.TestReport(
        nodeid=printable(f"{PSEUDO_PATH}::gate[{text}]"),
        location=place,
        keywords={},
        outcome=outcome,
        longrepr=None if outcome == "passed" else said if outcome == "failed" else (PSEUDO_PATH, 0, said),
        when="call",
    )


def tell_junit(
    config: pytest.Config, properties: Iterable[tuple[str, str]], cases: Iterable[pytest.TestReport] = ()
) -> None:
    """Add properties and test cases to the JUnit file, where one is written; no other plugin is told."""
    listed, reports = list(properties), list(cases)
    for plugin in config.pluginmanager.get_plugins():
        if not hasattr(plugin, "add_global_property"):
            continue
        for name, value in listed:
            plugin.add_global_property(name, value)
        for report in reports:
            plugin.pytest_runtest_logreport(report)
            plugin.finalize(report)
