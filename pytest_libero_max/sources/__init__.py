"""The catalogues of source variations: LIBERO-Plus's 10,030 and LIBERO-PRO's 400, for the embedded scenes.

A catalogue is a pure function of this package's code. Each variation is data: what a scene has to contain,
and the changes at reset (see :class:`.variant.Variant`).
"""

from __future__ import annotations

from pytest_libero_max.sources.lookup import (
    Counts,
    catalogue,
    count_lines,
    open_substrate,
    variant_metadata,
    variant_of,
)
from pytest_libero_max.sources.variation import Variant, digest_of

__all__ = [
    "Counts",
    "Variant",
    "catalogue",
    "count_lines",
    "digest_of",
    "open_substrate",
    "variant_metadata",
    "variant_of",
]
