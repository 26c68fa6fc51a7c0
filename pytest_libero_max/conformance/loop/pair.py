"""Rules for a pair: until the event, a loop does in Dynamic what it did in Base."""

from __future__ import annotations

from pytest_libero_max.conformance.loop.episodes import PLAYS
from pytest_libero_max.conformance.loop.spies import Asked
from pytest_libero_max.conformance.loop.subject import EVENT_AT, LoopSubject, PlayedEpisode
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule
from pytest_libero_max.errors import counted


@rule("loop/pair/seeds", "must", needs=PLAYS)
def same_seeds(subject: LoopSubject) -> Finding:
    """Reset the environment with the same seed in both arms."""
    first, second = ([reset.seed for reset in arm.resets] for arm in (subject.base, subject.dynamic))
    if first == second:
        return kept(f"both arms are reset with seed={first[0]}")
    return broken(
        f"reset with seed={_words(first)} in Base and with seed={_words(second)} in Dynamic",
        "the same seed",
        "Take the seed from the case and not from a counter: a pair compares one scene with itself.",
    )


def _words(seeds: list[int | None]) -> str:
    return ", ".join(map(str, seeds))


@rule("loop/pair/prefix", "must", needs="loop/actions/left-over")
def same_prefix(subject: LoopSubject) -> Finding:
    """Ask the same queries in both arms until the event."""
    base, dynamic = (_before_event(arm) for arm in (subject.base, subject.dynamic))
    for first, second in zip(base, dynamic, strict=False):
        differing = [
            name
            for name, a, b in (
                ("step", first.step, second.step),
                ("observation", first.digest, second.digest),
                ("instruction", first.instruction, second.instruction),
            )
            if a != b
        ]
        if differing:
            return broken(
                f"another {differing[0]} in Dynamic than in Base, in the query after "
                f"{counted(first.step, 'step')}",
                "the same queries until the event",
                "What a loop adds has to be the same in both arms: seed its noise from the case.",
            )
    return kept(f"both arms ask the same {counted(len(base), 'query', 'queries')} before the event")


@rule("loop/pair/generators", "note", needs=PLAYS)
def same_generators(subject: LoopSubject) -> Finding:
    """Begin both arms with the same state of the global generators."""
    first, second = (arm.queries[0].drawn for arm in (subject.base, subject.dynamic))
    differing = [name for name, a, b in zip(("random", "numpy.random"), first, second, strict=True) if a != b]
    if not differing:
        return kept("both arms begin with the same state of random and numpy.random")
    return broken(
        f"both arms begin with different states of {' and '.join(differing)}",
        "the same state",
        "A policy that draws its noise there differs between the arms by chance: seed the generators when an "
        "episode begins, or let the policy draw from seeds of its own.",
    )


def _before_event(arm: PlayedEpisode) -> list[Asked]:
    return [query for query in arm.queries if query.step < EVENT_AT]
