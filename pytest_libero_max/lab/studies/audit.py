"""Audit of a policy's inputs: the same cases without its images, its state, or its instruction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.events.schedules import Arm, Entry
from pytest_libero_max.events.triggers import AtStart
from pytest_libero_max.studies.study import Study

if TYPE_CHECKING:
    from pytest_libero_max.changes.change import Change
    from pytest_libero_max.policies.contract import PolicySpec
    from pytest_libero_max.tasks.libero_tasks import Task

ANOTHER_GOAL = "task"
"""Source category whose instruction is not that of LIBERO's task."""

REWORDED = ("Language Instructions", "semantic")
"""Source categories whose instruction is in other words already."""


class Audit(Study):
    """Base, and Base with one input changed before the first query.

    An arm with less success than Base shows that the policy needs the input. Dynamic is played as in any run.
    """

    name = "audit"
    title = "Audit of inputs"
    track = "smoke"
    has_section = True

    def arms(self, case: Case, spec: PolicySpec, strength: float = 1.0) -> tuple[Arm, ...]:
        changes = (*_without_images(spec, case), *_without_state(), *_other_words(case))
        return tuple(Arm(name, (Entry(AtStart(), change),)) for name, change in changes)


def _without_images(spec: PolicySpec, case: Case) -> Iterator[tuple[str, Change]]:
    from pytest_libero_max.changes.inputs import FreezeImages, HideInputs, SwapImages
    from pytest_libero_max.worlds.contract import height_and_width

    if not spec.cameras:
        return
    shown = (spec.cameras, *height_and_width(spec.image_size))
    yield "black_images", HideInputs(spec.cameras, state=False)
    yield "still_images", FreezeImages(*shown)
    other = _task_elsewhere(case)
    if other is not None:
        yield "other_images", SwapImages(*shown, other.suite, other.index, case.init_state_index)
    if len(spec.cameras) > 1:
        for camera in spec.cameras:
            yield f"no_{camera}", HideInputs((camera,), state=False)


def _without_state() -> Iterator[tuple[str, Change]]:
    from pytest_libero_max.changes.inputs import HideInputs

    yield "no_state", HideInputs((), state=True)


def _other_words(case: Case) -> Iterator[tuple[str, Change]]:
    from pytest_libero_max.changes.instruction import SetInstruction
    from pytest_libero_max.substrates.embedded.catalogue.wording import rewordings
    from pytest_libero_max.tasks.libero_tasks import tasks

    yield "no_instruction", SetInstruction("")
    task = _task_of(case)
    if task is None or case.source_category == ANOTHER_GOAL:
        return
    words = set(task.language.split())
    other = min(
        tasks(case.suite), key=lambda one: len(words & set(one.language.split())) / len(one.language.split())
    )
    yield "other_instruction", SetInstruction(other.language)
    if case.source_category not in REWORDED:
        style = "paraphrase"
        reworded = next(one.words for one in rewordings(task.language) if one.style == style)
        yield "paraphrase", SetInstruction(reworded, style)


def _task_elsewhere(case: Case) -> Task | None:
    """Return the next task of the suite that begins in another scene, cyclically; None for none."""
    from pytest_libero_max.tasks.libero_tasks import tasks

    task = _task_of(case)
    if task is None:
        return None
    suite = tasks(case.suite)
    following = (*suite[task.index + 1 :], *suite[: task.index])
    return next((one for one in following if _scene(one) != _scene(task)), None)


def _scene(task: Task) -> tuple[object, ...]:
    return task.arena, frozenset(task.objects), frozenset(task.start)


def _task_of(case: Case) -> Task | None:
    """Return the task of LIBERO with whose name that of the case begins; None for a scene of another kind."""
    from pytest_libero_max.tasks.libero_tasks import SUITES, tasks

    if case.suite not in SUITES:
        return None
    named = str(case.record.get("task_name", ""))
    found = [task for task in tasks(case.suite) if named.startswith(task.name)]
    return max(found, key=lambda task: len(task.name), default=None)
