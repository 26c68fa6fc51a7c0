"""The clock of all measurements: processor time of the whole process, render threads included."""

from __future__ import annotations

import time
from collections.abc import Callable


def processor_seconds(act: Callable[..., object], *arguments: object) -> float:
    """Return the processor time of a call: the time of one core, also when the machine is busy."""
    begin = time.process_time()
    act(*arguments)
    return time.process_time() - begin
