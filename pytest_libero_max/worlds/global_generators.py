"""The global generators of Python and NumPy: no result here draws from them, code of others may."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


@contextmanager
def global_generators_restored() -> Iterator[None]:
    """Restore the global generators after the block, whatever it drew or seeded."""
    of_python, of_numpy = random.getstate(), np.random.get_state()  # noqa: NPY002 - nothing is drawn from it
    try:
        yield
    finally:
        random.setstate(of_python)
        np.random.set_state(of_numpy)  # noqa: NPY002
