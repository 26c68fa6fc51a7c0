"""Rules for episodes, played to their end and no further, and for pairs, alike until the event."""

from __future__ import annotations

from pytest_libero_max.conformance.loop.spies import Asked, Executed, PolicyReset
from pytest_libero_max.conformance.loop.subject import EVENT_AT, LoopSubject, PlayedEpisode
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule
from pytest_libero_max.errors import counted

PLAYS = "loop/contract/plays"
WHOLE = "loop/episodes/whole"


@rule(PLAYS, "must")
def plays(subject: LoopSubject) -> Finding:
    """Play an episode of an environment with a policy, and return its success."""
    for episode in subject.episodes.values():
        lacking = "asked the policy nothing" if not episode.queries else ""
        lacking = lacking or ("executed nothing" if not episode.executed else "")
        if not lacking and episode.success is None:
            lacking = f"returned {episode.result!r}"
        if lacking:
            return broken(
                f"{episode.name}: the loop {lacking}",
                "queries, actions, and True or False, or a mapping with 'success'",
                "The loop is called with an environment and a policy, and plays one episode: "
                "def loop(env, policy) -> bool.",
            )
    return kept(f"{counted(len(subject.episodes), 'episode was', 'episodes were')} played")


@rule("loop/episodes/environment", "must", needs=PLAYS)
def environment_reset(subject: LoopSubject) -> Finding:
    """Begin an episode by one reset of the environment, and leave it until its end."""
    for episode in subject.episodes.values():
        late = [reset.at_step for reset in episode.resets[1:] if reset.at_step]
        if late:
            return broken(
                f"{episode.name}: the environment was reset after {counted(late[0], 'step')}, before its end",
                "no reset before terminated or truncated",
                "Reset the environment once, before the first step.",
            )
    return kept("an episode is begun by a reset and left until its end")


@rule("loop/episodes/policy", "must", needs=PLAYS)
def policy_reset(subject: LoopSubject) -> Finding:
    """Reset the policy before the first query of each episode, and not within it."""
    for episode in subject.episodes.values():
        resets = [
            sum(isinstance(earlier, Asked) for earlier in episode.entries[:place])
            for place, entry in enumerate(episode.entries)
            if isinstance(entry, PolicyReset)
        ]
        if 0 not in resets:
            return broken(
                f"{episode.name}: the policy was not reset before its first query",
                "policy.reset() when an episode begins",
                "A policy keeps queues and histories: call policy.reset() at each episode's start.",
            )
        if within := [count for count in resets if 0 < count < len(episode.queries)]:
            return broken(
                f"{episode.name}: the policy was reset after {counted(within[0], 'query', 'queries')}",
                "policy.reset() when an episode begins, and not within it",
                "Call policy.reset() once, before the first query.",
            )
    return kept("the policy is reset before the first query of each episode")


@rule(WHOLE, "must", needs=PLAYS)
def whole_budget(subject: LoopSubject) -> Finding:
    """Play on until the environment says that the episode has ended."""
    for episode in subject.episodes.values():
        steps = len(episode.executed)
        least = episode.script.success_at or episode.script.budget
        if steps < least:
            return broken(
                f"{episode.name}: the loop stopped after {counted(steps, 'step')}",
                f"{counted(least, 'step')}, where terminated or truncated is True",
                "Stop by terminated or truncated, or count single steps to env.max_steps.",
            )
    return kept("episodes are played to their end")


@rule("loop/episodes/after", "must", needs=PLAYS)
def nothing_after(subject: LoopSubject) -> Finding:
    """Execute nothing after the end of an episode."""
    for episode in subject.episodes.values():
        late = sum(isinstance(entry, Executed) and entry.ended for entry in episode.entries)
        if late:
            return broken(
                f"{episode.name}: {counted(late, 'action was', 'actions were')} executed after its end",
                "none",
                "Look at terminated and truncated after each action, also within a chunk.",
            )
    return kept("nothing is executed after the end of an episode")


@rule("loop/episodes/success", "must", needs=WHOLE)
def success(subject: LoopSubject) -> Finding:
    """Return the success of the step that ended the episode."""
    for episode in subject.episodes.values():
        right = episode.script.success_at is not None
        if episode.success is not right:
            end = (
                f"terminated at step {episode.script.success_at} of {episode.script.budget}"
                if right
                else f"truncated after {counted(episode.script.budget, 'step')}"
            )
            words = {True: "a success", False: "a failure"}
            return broken(
                f"{episode.name}, which was {end}, counts as {words[bool(episode.success)]}",
                words[right],
                "Take terminated (or info['is_success']) of the step that ended the episode: after it, an "
                "environment may begin the next one by itself.",
            )
    return kept("success and failure are read where the episode ends, also at the last step")


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
