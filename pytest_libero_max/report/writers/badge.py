"""Badges for a README, in the form that shields.io reads from an address (endpoint)."""

from __future__ import annotations

import json

from pytest_libero_max.conformance.results import Conformance
from pytest_libero_max.report.formats import percent
from pytest_libero_max.report.report_document import Report

BADGE_NAME = "badge.json"
CONFORMANCE_BADGE_NAME = "conformance-badge.json"

_BLUE, _GREY = "14708a", "8794a1"


def badge_json(report: Report) -> str:
    """Return the badge of a run: Base and Dynamic success, and the cases measured.

    A run that is incomplete has none, and its badge says so.
    """
    selection, case_set = report.selection, report.provenance["case_set"]["name"]
    cases = case_set.removeprefix("track ").removeprefix("manifest ")
    if selection is not None and not selection.whole:
        cases = f"{selection.chosen} of {selection.of} of {cases}"
    label = f"LIBERO-MAX {cases}, {report.substrate.name}"
    if not report.pairs.complete:
        return _endpoint(label, "incomplete", _GREY)
    overall = report.overall
    base, dynamic = percent(overall.base_success.value), percent(overall.dynamic_success.value)
    return _endpoint(label, f"Base {base}, Dynamic {dynamic}", _BLUE)


def conformance_badge_json(document: Conformance) -> str:
    """Return the badge of a subject: the number of rules that it keeps."""
    counts = document.counts
    message = f"{counts['kept']} of {len(document.rules) - counts['unexamined']} rules kept"
    if document.conforms is False:
        message += f", {counts['broken must']} must broken"
    if document.not_run:
        message += f", {len(document.not_run)} not run"
    label = f"LIBERO-MAX conformance, {document.subject}"
    return _endpoint(label, message, _BLUE if document.conforms else _GREY)


def _endpoint(label: str, message: str, color: str) -> str:
    return json.dumps({"schemaVersion": 1, "label": label, "message": message, "color": color}) + "\n"
