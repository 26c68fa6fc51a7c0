"""What broke in Base, where Base solves less than half: by cause, with what to do next.

A pair that Base loses cannot be lost to an event. Where there are many of them, their causes say what to mend
first, and most often that is the adapter.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from pytest_libero_max.events.schedules import BASE
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.diagnosis import CAUSES, NOT_RECORDED, diagnose
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.report_document import BaseFailures, Report

TITLE = "What broke in Base"

_MOST_NAMED = 20


class Advice(NamedTuple):
    """What failures of Base look like, what they most often mean, and which causes belong to it."""

    sight: str
    """What is seen where Base fails."""
    meaning: str
    """What it most often means, and what to look at."""
    causes: tuple[str, ...]
    """Causes of failed arms that look so."""


ADVICE = (
    Advice(
        "the hand does not come near the right object",
        "Images are turned the wrong way, or cameras exchanged: look at the film of what the policy saw",
        ("never_reached", "wrong_object", "blocked_by_obstacle", "stuck"),
    ),
    Advice(
        "the hand arrives and does not hold",
        "The gripper has the wrong sign or range; beside the object: actions are un-normalised wrongly, or "
        "the state has another form",
        (
            "never_closed",
            "closed_early",
            "grasp_missed",
            "grasp_slipped",
            "dropped",
            "toppled_target",
            "pushed_target",
            "part_not_moved",
        ),
    ),
    Advice(
        "the hand hardly moves, or stops moving",
        "Actions are in other units, or an old answer is returned: run `libero-max check` on the adapter",
        ("not_attempted", "froze", "timed_out"),
    ),
    Advice(
        "the hand takes the objects and does not finish",
        "Q, the form of the state or the size of the images differ from the model's own evaluation, or the "
        "model does not know these scenes",
        (
            "timed_out_holding",
            "placed_beside_goal",
            "placed_elsewhere",
            "moved_goal",
            "undone",
            "part_moved_too_little",
        ),
    ),
)
"""The table of `AGENTS.md`. A cause belongs to one row at most; the others say nothing about an adapter."""

_COMPARE = (
    "Look at a film of one. If the policy solves more in its own evaluation, compare the adapter with that: "
    "images, state, gripper, Q. Otherwise play more pairs."
)
"""Next step where Base solves less than half, and more than a wrong adapter does."""

_UNSEEN = "A model that has never seen these scenes may fail there with a right adapter."


def base_failures(records: Sequence[PairRecord]) -> list[BaseFailures]:
    """Return the failures of Base by cause, the most frequent first; none where Base solves half or more."""
    failed = [record for record in records if BASE in record.arms and not record.base_success]
    if 2 * len(failed) <= len(records):
        return []
    by_cause: dict[str, list[tuple[str, str]]] = {}
    for record in sorted(failed, key=lambda record: record.item_id):
        why = diagnose(record, BASE)
        assert why is not None
        by_cause.setdefault(why.cause, []).append((record.item_id, why.sentence))
    order = sorted(by_cause, key=lambda cause: (-len(by_cause[cause]), [*CAUSES].index(cause)))
    return [
        BaseFailures(
            cause=cause,
            pairs=len(by_cause[cause]),
            item_ids=[item for item, _ in by_cause[cause][:_MOST_NAMED]],
            sentence=by_cause[cause][0][1],
        )
        for cause in order
    ]


def known_failures(report: Report) -> list[BaseFailures]:
    """Return the failures of Base to show; none where no record says why."""
    causes = {group.cause for group in report.base_failures}
    return [] if causes <= {NOT_RECORDED} else report.base_failures


def title_of(report: Report) -> str:
    """Return the heading: the number of failures and of pairs."""
    return f"{TITLE}: {_failed(report.base_failures)} of {counted(report.overall.played, 'pair')}"


def next_step(report: Report) -> str:
    """Return what low Base success means, and what to do first."""
    from pytest_libero_max.stats.outcome_table import (
        FLOOR_BASE_RATE,
    )  # imports NumPy, and the plugin this module

    groups, played = report.base_failures, report.overall.played
    failed = _failed(groups)
    solved = played - failed
    # Below the floor a warning says that little or nothing can be lost.
    low = solved < FLOOR_BASE_RATE * played
    text = (
        "" if low else f"Base solves {solved} of {counted(played, 'pair')}, so events have little to break."
    )
    advice, number = _most(groups)
    sight = f"in {number} of {failed} failures {advice.sight}" if advice is not None else ""
    own = report.substrate.scores_comparable_with_published is False  # no model was trained on its scenes
    unseen = f" {_UNSEEN}" if own and not (report.policy or {}).get("privileged") else ""
    if not low:  # an adapter that is wrong solves less
        text = f"{text} {sight.capitalize()}." if sight else text
        return f"{text} {_COMPARE}{unseen}"
    if advice is None:
        return "Fix Base first: look at a film of it."
    return f"Fix Base first: {sight}. {advice.meaning}.{unseen}"


def _failed(groups: Iterable[BaseFailures]) -> int:
    return sum(group.pairs for group in groups)


def _most(groups: Sequence[BaseFailures]) -> tuple[Advice | None, int]:
    """Return the row of the table that most failures belong to, with their number."""
    numbers = [_failed(group for group in groups if group.cause in advice.causes) for advice in ADVICE]
    most = max(numbers)
    return (ADVICE[numbers.index(most)], most) if most else (None, 0)
