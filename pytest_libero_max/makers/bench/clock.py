"""Common parts of measurements: processor time, and processes that begin together."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from threading import Barrier
from typing import TypeVar

Result = TypeVar("Result")

_WAIT_S = 600.0
"""The longest that a process waits for the others, which build their scenes at the same time."""

_barriers: list[Barrier] = []


def processor_seconds(act: Callable[..., object], *arguments: object) -> float:
    """Return the processor time of a call, render threads included: the time of one idle core."""
    begin = time.process_time()
    act(*arguments)
    return time.process_time() - begin


def in_processes(number: int, act: Callable[..., Result], *arguments: object) -> list[Result]:
    """Return the results of a function, called in some processes at once; see :func:`wait_for_others`."""
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(number)
    with ProcessPoolExecutor(number, context, initializer=_meet, initargs=(barrier,)) as pool:
        tasks = [pool.submit(_call, act, arguments) for _ in range(number)]
        return [task.result() for task in tasks]


def wait_for_others() -> None:
    """Wait, within a function of :func:`in_processes`, until all of them are here."""
    _barriers[0].wait(_WAIT_S)


def _meet(barrier: Barrier) -> None:
    _barriers.append(barrier)


def _call(act: Callable[..., Result], arguments: tuple[object, ...]) -> Result:
    try:
        return act(*arguments)
    except BaseException:
        _barriers[0].abort()  # the others would wait for this one
        raise
