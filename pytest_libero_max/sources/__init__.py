"""The catalogues of source variations: LIBERO-Plus's 10,030 and LIBERO-PRO's 400, for the embedded scenes.

A catalogue is a pure function of this package's code. Each variation is data: what a scene has to contain,
and the changes at reset (see :class:`.variation.Variation`).
"""

from __future__ import annotations

from pytest_libero_max.sources.lookup import (
    Counts,
    catalogue,
    count_lines,
    variation_metadata,
    variation_of,
)
from pytest_libero_max.sources.substrates import lacking, open_substrate
from pytest_libero_max.sources.variation import Variation, digest_of

__all__ = [
    "Counts",
    "Variation",
    "catalogue",
    "count_lines",
    "digest_of",
    "lacking",
    "open_substrate",
    "variation_metadata",
    "variation_of",
]
