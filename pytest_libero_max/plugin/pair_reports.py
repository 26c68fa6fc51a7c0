"""Pair records in pytest's test reports: attached by the player, read and shown by the controller."""

from __future__ import annotations

import json
from collections.abc import Generator
from contextlib import suppress
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ReportError, SimulatorError
from pytest_libero_max.pairing.record import (
    CRASH_PHASE,
    RECORD_PHASE,
    PairError,
    PairRecord,
    is_error,
    result_from_dict,
)
from pytest_libero_max.plugin.collection import PairItem
from pytest_libero_max.plugin.processes.sending import sendable
from pytest_libero_max.plugin.stash_keys import (
    NOTE,
    NOTE_ATTRIBUTE,
    RESULT,
    RESULT_ATTRIBUTE,
    STATUS_ATTRIBUTE,
    STOP,
    STOP_ATTRIBUTE,
)


@pytest.hookimpl(wrapper=True, trylast=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Attach the result of a pair to the report of the phase in which it arises, once, as JSON types.

    Before the wrappers of other plugins, some of which write what was logged as UTF-8.
    """
    report = yield
    if isinstance(item, PairItem):
        report.sections = sendable(report.sections)
    result = item.stash.get(RESULT, None)
    if result is not None and call.when == ("setup" if is_error(result) else "call"):
        setattr(report, RESULT_ATTRIBUTE, result)
        setattr(report, NOTE_ATTRIBUTE, item.stash.get(NOTE, None))
        setattr(report, STOP_ATTRIBUTE, item.stash.get(STOP, None))
        del item.stash[RESULT]  # another plugin may play the item again
    return report


@pytest.hookimpl(wrapper=True)
def pytest_report_to_serializable() -> Generator[None, dict[str, Any] | None, dict[str, Any] | None]:
    """Send the result of a pair as one text."""
    return packed((yield))


@pytest.hookimpl(wrapper=True)
def pytest_report_from_serializable(data: dict[str, Any]) -> Generator[None, Any, Any]:
    """Read the text back."""
    unpacked(data)
    return (yield)


def packed(data: dict[str, Any] | None) -> dict[str, Any] | None:
    """Return a report for another process with the result of its pair as one text.

    Otherwise xdist takes it apart into its some 400 values, one by one, and puts it together again.
    What JSON does not know stays as it is, and is refused where it is stored.
    """
    if data is not None and isinstance(data.get(RESULT_ATTRIBUTE), dict):
        with suppress(TypeError, ValueError):
            data[RESULT_ATTRIBUTE] = json.dumps(data[RESULT_ATTRIBUTE])
    return data


def unpacked(data: dict[str, Any]) -> dict[str, Any]:
    """Return a report from another process as it was before :func:`packed`.

    Its properties are tuples again, which xdist sends as lists. pytest keeps all of them until the process
    ends, and Python's garbage collector looks at each list every time, but not at a tuple of two texts.
    """
    if isinstance(data.get(RESULT_ATTRIBUTE), str):
        data[RESULT_ATTRIBUTE] = json.loads(data[RESULT_ATTRIBUTE])
    if isinstance(data.get("user_properties"), list):
        data["user_properties"] = [
            tuple(one) if isinstance(one, list) else one for one in data["user_properties"]
        ]
    return data


def result_of(report: pytest.TestReport, case: Case) -> PairRecord | PairError | None:
    """Return the result of a pair from one of its reports; None where this report does not have it."""
    result = getattr(report, RESULT_ATTRIBUTE, None)
    if result is not None:
        try:
            return result_from_dict(result)
        except ReportError as error:
            return PairError.of(case, error, RECORD_PHASE)
    if not report.failed:
        return None
    # The item ended without a result: its worker died, or somebody's hook failed it.
    text = str(report.longrepr).strip().splitlines()
    return PairError.of(case, SimulatorError(text[-1] if text else "no message"), CRASH_PHASE)


def pytest_report_teststatus(report: Any) -> tuple[str, str, str] | None:
    """Return category, letter and sentence of a measured pair for the terminal; None for any other report.

    They stay on the report: it is asked for them again at the end with ``-rA``, without its record.
    """
    known: tuple[str, str, str] | None = getattr(report, STATUS_ATTRIBUTE, None)
    if known is not None:
        return known
    result = getattr(report, RESULT_ATTRIBUTE, None)
    if result is None or is_error(result):
        return None
    try:
        return keep_status(report, PairRecord.from_dict(result))
    except ReportError:
        return None  # the controller stores why


def keep_status(report: Any, pair: PairRecord) -> tuple[str, str, str] | None:
    """Keep what the terminal shows of a pair on its report, and return it; None for a test that failed."""
    if report.when != "call" or not report.passed:
        return None
    from pytest_libero_max.runs.progress import status

    known = status(pair)
    setattr(report, STATUS_ATTRIBUTE, known)
    return known
