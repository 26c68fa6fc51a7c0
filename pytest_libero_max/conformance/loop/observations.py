"""Rules for what a loop shows the policy: fresh, all of one step, with the instruction of that step."""

from __future__ import annotations

from pytest_libero_max.conformance.loop.episodes import PLAYS
from pytest_libero_max.conformance.loop.spies import Asked
from pytest_libero_max.conformance.loop.subject import LoopSubject
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.errors import counted

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
