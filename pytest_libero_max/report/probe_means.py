"""Means of what probes measured, for the reports: one number for each numeric column and arm."""

from __future__ import annotations

from collections.abc import Iterable
from math import fsum

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.diagnosis import STAGES
from pytest_libero_max.report.measured import number

TITLE = "Probes: means over pairs"


def probe_means(records: Iterable[PairRecord]) -> dict[str, dict[str, str | float | None]]:
    """Return a section of the report with the columns of the probes that were asked for; empty without any.

    A name is ``PROBE.COLUMN, ARM``. True counts as 1, so that its mean is a share. Columns of lists and of
    texts are left out, and so are arms whose value is None.
    """
    values: dict[str, list[float]] = {}
    for record in records:
        for arm, played in record.arms.items():
            for probe, columns in played.probes.items():
                for column, value in columns.items():
                    if probe != STAGES and isinstance(value, int | float):
                        values.setdefault(f"{probe}.{column}, {arm}", []).append(value)
    means: dict[str, str | float | None] = {
        name: number(fsum(values[name]) / len(values[name])) for name in sorted(values)
    }
    return {TITLE: means} if means else {}
