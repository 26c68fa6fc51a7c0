"""Cases of robosuite's tasks: an event at one of their initial states."""

from __future__ import annotations

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.lab.robosuite.robots import ROBOTS
from pytest_libero_max.lab.robosuite.tasks import TASKS


def examples() -> tuple[Case, ...]:
    """Return a case of each event, in the first task that can host it, with each arm in turn."""
    suites = [*ROBOTS]
    hosts = (
        (event, next(index for index, task in enumerate(TASKS) if eligible(event, task.metadata)))
        for event in BENCHMARK_EVENTS
    )
    return tuple(
        make_case(event, suites[number % len(suites)], index) for number, (event, index) in enumerate(hosts)
    )
