"""Cases of robosuite's tasks: an event at one of their initial states."""

from __future__ import annotations

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.lab.robosuite.robots import ROBOTS
from pytest_libero_max.lab.robosuite.tasks import TASKS, task_of


def robosuite_case(event: str, suite: str, index: int, init: int = 0, *, variant: int = 0) -> Case:
    """Return the case of an event in a task; the same arguments give the same case.

    Raises:
        ManifestError: There is no such event or variant, or the task cannot host it.
        SubstrateError: There is no such task.
    """
    return make_case(event, suite, index, init, variant=variant, task=task_of(index).metadata)


def examples() -> tuple[Case, ...]:
    """Return a case of each event, in the first task that can host it, with each arm in turn."""
    suites = [*ROBOTS]
    hosts = (
        (event, next(index for index, task in enumerate(TASKS) if eligible(event, task.metadata)))
        for event in BENCHMARK_EVENTS
    )
    return tuple(
        robosuite_case(event, suites[number % len(suites)], index)
        for number, (event, index) in enumerate(hosts)
    )
