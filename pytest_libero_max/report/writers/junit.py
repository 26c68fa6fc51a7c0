"""Properties in JUnit files: of the suite, and of each pair's testcase."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.broken import LETTERS, groups_of
from pytest_libero_max.report.diagnosis import diagnose
from pytest_libero_max.report.report_document import ChangedPair, Report

PREFIX = "libero_max_"


def properties(record: PairRecord) -> list[tuple[str, str]]:
    """Names and values for ``user_properties``, in a fixed order; a value that does not exist is left out."""
    why = diagnose(record, BASE if record.dynamic_success else DYNAMIC)
    values = {
        "case_id": record.case_id,
        "outcome": record.outcome,
        "base_success": _flag(record.base_success),
        "dynamic_success": _flag(record.dynamic_success),
        "triggered": _flag(record.triggered),
        "responded": _flag(record.responded),
        "base_steps": str(record.base_steps),
        "dynamic_steps": str(record.dynamic_steps),
        "trigger_step": _text(record.trigger_step),
        "response_step": _text(record.response_step),
        "stale_actions": _text(record.stale_actions),
        "prefix_digest": _text(record.prefix_digest),
        "cause": None if why is None else why.cause,
        "diagnosis": None if why is None else why.sentence,
    }
    return [(PREFIX + name, value) for name, value in values.items() if value is not None]


def suite_properties(selection: Selection, case_set: str) -> list[tuple[str, str]]:
    """Return names and values for the properties of the whole suite: the played part of the case set."""
    values = {
        "cases": selection.text(case_set),
        "selection_digest": selection.digest,
        "whole_track": _flag(selection.whole),
    }
    return [(PREFIX + name, value) for name, value in values.items()]


def broken_properties(pairs: Sequence[ChangedPair]) -> list[tuple[str, str]]:
    """Names and values for the properties of the whole suite: the pairs whose outcome changed, by cause."""
    return [
        (f"{PREFIX}{outcome}", f"{letter} {', '.join(words)}{f': {pair.sentence}' if pair.sentence else ''}")
        for outcome, letter in LETTERS.items()
        for group in groups_of(pairs, outcome)
        for pair in group.named
        for words in [[pair.item_id, group.what, *([group.cause] if group.cause else [])]]
    ]


def headline_properties(report: Report) -> list[tuple[str, str]]:
    """Return names and values for the properties of the whole suite: status, main numbers, and each caveat.

    A run that is incomplete has counts, and no rates.
    """
    from pytest_libero_max.report.run_tables import (
        main_numbers,  # with NumPy, which pytest's start does without
    )
    from pytest_libero_max.report.run_texts import clipping_text, note_texts

    numbers: dict[str, float | str | None] = {"status": report.headline.status, **main_numbers(report)}
    if report.pairs.complete:
        numbers["p_value"] = report.overall.mcnemar.p_value
    found = [(name.replace("/", "_"), str(value)) for name, value in numbers.items() if value is not None]
    texts = [*report.warnings, *note_texts(report), clipping_text(report), report.substrate.note]
    found += [("caveat", text) for text in texts if text]
    return [(PREFIX + name, value) for name, value in found]


def _flag(value: bool) -> str:
    return "true" if value else "false"


def _text(value: object) -> str | None:
    return None if value is None else str(value)
