"""Columns of probes as quantities of a set of pairs: a mean and a largest value by arm."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import fsum

from pytest_libero_max.errors import did_you_mean
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.diagnosis import STAGES
from pytest_libero_max.report.formats import Mean
from pytest_libero_max.report.gate_arguments import refused
from pytest_libero_max.report.quantities import Quantity
from pytest_libero_max.stats.blocks import ProbeMean, Result
from pytest_libero_max.stats.measured import number

TITLE = "Probes: means over pairs"


def probe_means(records: Iterable[PairRecord]) -> dict[str, ProbeMean]:
    """Return the numeric columns of the probes that were asked for, by ``PROBE.COLUMN.ARM``.

    Columns of lists and of texts are left out, and so are arms whose value is None.
    """
    values: dict[str, list[float]] = {}
    for record in records:
        for arm, played in record.arms.items():
            for probe, columns in played.probes.items():
                for column, value in columns.items():
                    if probe != STAGES and isinstance(value, int | float):
                        values.setdefault(f"{probe}.{column}.{arm}", []).append(value)
    return {
        name: ProbeMean(
            pairs=len(known), mean=number(fsum(known) / len(known)) or 0.0, largest=number(max(known)) or 0.0
        )
        for name, known in sorted(values.items())
    }


def probe_quantity(key: str) -> Quantity[Result]:
    """Return a column of a probe in an arm as a quantity."""
    return Quantity(key, key, lambda row: row.probes.get(key), Mean(), tables=())


def probe_quantities(rows: Sequence[Result]) -> list[Quantity[Result]]:
    """Return the columns of probes that some sets of pairs have."""
    return [probe_quantity(key) for key in sorted({key for row in rows for key in row.probes})]


def probe_key(name: str, text: str) -> str | None:
    """Return the key of the quantity of a gate that is a column of a probe; None for a name of no probe.

    Args:
        name: ``PROBE.COLUMN`` for Dynamic, or ``PROBE.COLUMN.ARM``.
    """
    from pytest_libero_max.pairing.probes.registry import PROBES

    probe, _, rest = name.partition(".")
    column, _, arm = rest.partition(".")
    if probe not in PROBES:
        return None
    known = [one.name for one in PROBES[probe].schema if not one.many and one.type != "str"]
    if column not in known:
        raise refused(text, f" has the unknown quantity {probe}.{column!r}. {did_you_mean(column, known)}")
    return f"{probe}.{column}.{arm or 'dynamic'}"
