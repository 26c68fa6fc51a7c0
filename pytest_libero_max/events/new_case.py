"""Cases made in Python: an event in a task of a known suite, without a source variation."""

from __future__ import annotations

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.events.registry import resolve_event
from pytest_libero_max.substrates.registry import contents_of


def make_case(
    event: str, suite: str, task_index: int, init_state_index: int = 0, *, variant: int = 0
) -> Case:
    """Return the case of an event in an unmodified task; the same arguments give the same case.

    Args:
        event: Name of the event, for example ``camera_shift``.
        suite: For example ``libero_spatial``, or one that another package adds.
        task_index: Index of the task in its suite, from 0.
        init_state_index: Index of the initial state; of LIBERO's tasks 0 to 9, or 10 to 49 for training data.

    Raises:
        ManifestError: There is no such event or variant, or the task cannot host it.
    """
    task = contents_of(suite, task_index)
    identity = Identity.unmodified(suite, task_index, init_state_index)
    return parse_case(case_record(identity, resolve_event(event, variant, task, identity), task.name))
