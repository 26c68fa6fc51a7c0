"""A badge for a README: the result of a run in the form that shields.io reads from an address (endpoint)."""

from __future__ import annotations

import json

from pytest_libero_max.report.formats import percent
from pytest_libero_max.report.report_document import Report

BADGE_NAME = "badge.json"

_BLUE, _GREY = "14708a", "8794a1"


def badge_json(report: Report) -> str:
    """Return the badge of a run: Base and Dynamic success, and the cases measured.

    A run that is incomplete has none, and its badge says so.

    Args:
        report: As in ``report.json``.
    """
    selection, case_set = report.selection, report.provenance["case_set"]["name"]
    cases = case_set.removeprefix("track ").removeprefix("manifest ")
    if selection is not None and not selection.whole:
        cases = f"{selection.chosen} of {selection.of} of {cases}"
    label = f"LIBERO-MAX {cases}, {report.substrate.name}"
    message, color = "incomplete", _GREY
    if report.pairs.complete:
        overall = report.overall
        base, dynamic = percent(overall.base_success.value), percent(overall.dynamic_success.value)
        message, color = f"Base {base}, Dynamic {dynamic}", _BLUE
    return json.dumps({"schemaVersion": 1, "label": label, "message": message, "color": color}) + "\n"
