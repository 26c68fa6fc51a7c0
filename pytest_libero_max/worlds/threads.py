"""How many threads linear algebra may use: one."""

from __future__ import annotations

import os

_VARIABLE = "OPENBLAS_NUM_THREADS"


def use_one_blas_thread() -> None:
    """Keep the BLAS of NumPy and SciPy to one thread, here and in processes started from here.

    The matrices of a control step have six or seven rows: more threads only wait for each other, and take
    the processors from the other workers (measured: twice the processor time for the same episodes). A value
    that the user set is kept, and a BLAS that has been loaded already stays as it is.
    """
    os.environ.setdefault(_VARIABLE, "1")
