"""Rules for what a loop executes: the answers of the policy, in order, Q of each."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pytest_libero_max.conformance.loop.episodes import PLAYS
from pytest_libero_max.conformance.loop.spies import Asked, Executed, Q
from pytest_libero_max.conformance.loop.subject import LoopSubject, PlayedEpisode
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.errors import counted

EXECUTED = "loop/actions/executed"

ROUNDING = 1e-6
"""Largest change of a component that single precision makes."""


@rule("loop/actions/waiting", "must", needs=PLAYS)
def no_waiting(subject: LoopSubject) -> Finding:
    """Execute nothing before the first query."""
    for episode in subject.episodes.values():
        count, _ = _before_first_query(subject, episode)
        if count:
            return broken(
                f"{episode.name}: {counted(count, 'action was', 'actions were')} executed that no query "
                "answered, before the first query",
                "the first query before the first action",
                "The world has settled when reset() returns: leave waiting steps out, or put LiberoLoop "
                "around the environment, which does not execute them.",
            )
    return kept("nothing is executed before the first query")


@rule("loop/actions/left-over", "must", needs=PLAYS)
def nothing_left_over(subject: LoopSubject) -> Finding:
    """Execute no action of an earlier episode."""
    for episode in subject.episodes.values():
        own = {query.number for query in episode.queries}
        old = [
            number
            for number, _, source in subject.sources(episode)
            if source is not None and source.query.number not in own
        ]
        if old:
            return broken(
                f"{episode.name}: {counted(len(old), 'action')} of an episode before, the first at step "
                f"{old[0]}",
                "answers of this episode alone",
                "The queue of actions lives on: empty it when an episode begins.",
            )
    return kept("no action of an earlier episode is executed")


def _before_first_query(subject: LoopSubject, episode: PlayedEpisode) -> tuple[int, int]:
    """Return the numbers of actions before the first query: those of no answer, and of earlier answers."""
    count = 0
    for entry in episode.entries:
        if isinstance(entry, Asked):
            break
        count += isinstance(entry, Executed)
    first = [source for number, _, source in subject.sources(episode) if number < count]
    foreign = sum(source is None for source in first)
    return foreign, len(first) - foreign


def _chunks(episode: PlayedEpisode) -> Iterator[tuple[Asked, list[Executed]]]:
    """Yield each query with the actions that were executed before the next one."""
    query: Asked | None = None
    actions: list[Executed] = []
    for entry in episode.entries:
        if isinstance(entry, Asked):
            if query is not None:
                yield query, actions
            query, actions = entry, []
        elif isinstance(entry, Executed) and not entry.ended and query is not None:
            actions.append(entry)
    if query is not None:
        yield query, actions


@rule(EXECUTED, "must", needs=PLAYS)
def executed_as_answered(subject: LoopSubject) -> Finding:
    """Execute the actions of an answer as they are, from the first one on."""
    count = 0
    for episode in subject.episodes.values():
        for query, actions in _chunks(episode):
            for row, entry in enumerate(actions):
                count += 1
                if finding := _differs(subject, episode, query, row, entry):
                    return finding
    return kept(f"{counted(count, 'action is', 'actions are')} executed as answered")


def _differs(
    subject: LoopSubject, episode: PlayedEpisode, query: Asked, row: int, entry: Executed
) -> Finding | None:
    """Return the finding of an action that is not the row of the answer that is due; None where it is."""
    due = query.chunk[row] if row < len(query.chunk) else None
    if due is not None and np.abs(due - entry.action).max() <= ROUNDING:
        return None
    where = f"{episode.name}: action {row} after the query after {counted(query.step, 'step')}"
    own = {asked.number for asked in episode.queries}
    sources = {number: source for number, executed, source in subject.sources(episode) if executed is entry}
    source = next(iter(sources.values()), None)
    if source is not None and source.query.number not in own:
        return None  # of an episode before, which has a rule of its own
    if source is not None and (source.query.number, source.row) != (query.number, row):
        whose = "of that answer" if source.query.number == query.number else "of another answer"
        return broken(
            f"{where} was action {source.row} {whose}",
            f"action {row} of that answer",
            "Execute an answer from its first action on, each once.",
        )
    component = 0 if due is None else int(np.abs(due - entry.action).argmax())
    answered = "nothing" if due is None else f"{due[component]:g}"
    return broken(
        f"{where} had {entry.action[component]:g} as component {component}",
        f"{answered}, as answered",
        "The policy's adapter makes actions playable: execute them unchanged.",
    )


@rule("loop/actions/interval", "must", needs=EXECUTED)
def interval(subject: LoopSubject) -> Finding:
    """Ask the policy after every Q actions."""
    for episode in subject.episodes.values():
        counts = [len(actions) for _, actions in _chunks(episode)]
        wrong = [count for count, _ in pairwise(counts) if count != Q] + [n for n in counts[-1:] if n > Q]
        if wrong:
            return broken(
                f"{episode.name}: {counted(wrong[0], 'action was', 'actions were')} executed before the next "
                "query",
                f"query_interval={Q}",
                f"Execute actions[:{Q}], the policy's query_interval, and then ask again.",
            )
    return kept(f"the policy is asked after every Q={Q} actions")


@rule("loop/actions/beyond", "should", needs=EXECUTED)
def beyond(subject: LoopSubject) -> Finding:
    """Execute movements beyond 1 as they are, or clipped to 1."""
    query, actions = next(iter(_chunks(subject.beyond)), (None, []))
    if query is None or not actions:
        return unexamined("nothing was executed")
    value, answered = float(actions[0].action[3]), float(query.chunk[0, 3])
    if abs(value - answered) <= ROUNDING:
        return kept("movements beyond 1 are executed as they are")
    if abs(value - 1) <= ROUNDING:
        return kept("movements beyond 1 are clipped to 1")
    return broken(
        f"a movement of {answered:g} was executed as {value:g}",
        f"{answered:g}, or 1",
        "Clip each component alone: scaling changes the direction.",
    )
