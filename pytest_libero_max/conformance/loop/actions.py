"""Rules for what a loop executes, Q actions of each answer in order, and for what it shows the policy."""

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


FRESH = "loop/observations/fresh"


def _queries(subject: LoopSubject) -> list[tuple[str, Asked]]:
    return [(episode.name, query) for episode in subject.episodes.values() for query in episode.queries]


@rule(FRESH, "must", needs=PLAYS)
def fresh_images(subject: LoopSubject) -> Finding:
    """Show the policy the images of the step at which it is asked."""
    queries = _queries(subject)
    if not any(query.image_steps for _, query in queries):
        return unexamined("the policy was shown no images")
    for name, query in queries:
        wrong = [step for step in query.image_steps if step != query.step]
        if wrong:
            made = "at no step of the episode" if wrong[0] is None else f"after {counted(wrong[0], 'step')}"
            return broken(
                f"{name}: a query after {counted(query.step, 'step')} was shown an image made {made}",
                "the images of the last observation",
                "Pass on what the last step() or reset() returned; do not keep an image of an earlier query.",
            )
    return kept(f"{counted(len(queries), 'query was', 'queries were')} shown fresh images")


@rule("loop/observations/state", "must", needs=PLAYS)
def fresh_state(subject: LoopSubject) -> Finding:
    """Show the policy the state of the step at which it is asked."""
    queries = [(name, query) for name, query in _queries(subject) if query.state_step is not None]
    if not queries:
        return unexamined("the policy was shown no state whose name is known")
    for name, query in queries:
        if query.state_step != query.step:
            return broken(
                f"{name}: a query after {counted(query.step, 'step')} was shown the state after "
                f"{counted(query.state_step or 0, 'step')}",
                "the state of the last observation",
                "Take state and images from the same observation.",
            )
    return kept(f"{counted(len(queries), 'query was', 'queries were')} shown the state of its step")


@rule("loop/observations/overwritten", "should", needs=PLAYS)
def not_overwritten(subject: LoopSubject) -> Finding:
    """Leave alone what the policy was shown before."""
    _queries(subject)  # plays them
    written = sorted(subject.policy.images_written)
    if not written:
        return kept("earlier observations stay as they were")
    return broken(
        f"the arrays of {counted(len(written), 'query was', 'queries were')} written to later",
        "arrays of their own for each query",
        "A buffer is used again: a policy that keeps a history then sees one image many times. Copy it.",
    )


@rule("loop/observations/instruction", "should", needs=PLAYS)
def instruction(subject: LoopSubject) -> Finding:
    """Give the policy the instruction of the step at which it is asked."""
    for name, query in _queries(subject):
        if query.current.lower() not in query.instruction.lower():
            return broken(
                f"{name}: a query after {counted(query.step, 'step')} had the instruction "
                f"{query.instruction!r}",
                f"{query.current!r}, which the environment gives at that step",
                "Read info['instruction'] or env.task_description at each query: events may change it.",
            )
    return kept("each query has the instruction of its step, also after it changed")
