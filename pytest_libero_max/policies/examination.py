"""Examination of a policy before a run: a few queries that find the usual mistakes of adapters.

Nothing is played. The policy is shown made-up and recorded observations, always as the pair runner would show
them, and its behaviour is compared with its declarations. The inputs of its model can only be compared where
the policy offers ``model_inputs(observation, query)``, a mapping of those inputs; policies behind servers do.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import LiberoMaxError, counted
from pytest_libero_max.policies.check import (
    Actions,
    ask,
    ask_together,
    batches,
    copy_memory,
    memory_of,
    remembers,
    restore_memory,
    start,
)
from pytest_libero_max.policies.clients.transport import LOG as SERVER_LOG
from pytest_libero_max.policies.contract import BatchItem, Episode, Policy
from pytest_libero_max.policies.finding import Finding, Shown, doubt, note, ok, skip, wrong
from pytest_libero_max.policies.model_inputs import INPUTS, compare_inputs, marked_observation, model_inputs

FAR_BEYOND = 3.0
"""Components larger than this are in other units, not movements that overshoot [-1, 1]."""

LEAST_MOVEMENT = 0.06
"""Movements that are all below it, 3 mm a step, reach nothing within an episode; 0.05 is 5 cm in metres."""

LEAST_ROTATION = 0.01
"""A rotation that is below it throughout, 0.3 degrees a step, turns nothing within an episode."""

FAR_AWAY_M = 0.5
"""Largest plausible distance of the next target: a hand moves 5 cm in a step."""

MIXED_UP = 0.05
"""Largest difference between answers in a batch and alone that can be rounding."""

QUERIES = 4


def examine(policy: Policy, shown: Shown) -> list[Finding]:
    """Examine a policy; stop at the first query that cannot be answered."""
    findings: list[Finding] = []
    try:
        for look in (_answers, _repeats, _forgets, _writes, _looks, _carries, _batches, _follows_h, _inputs):
            findings += look(policy, shown)
    except LiberoMaxError as error:
        findings.append(
            wrong(
                "query",
                str(error).rstrip("."),
                "an answer to every query",
                "Repair this first, and check again.",
            )
        )
    return findings


def made_up(policy: Policy, world: Any, suite: str = "libero_spatial") -> Shown:
    """Return observations of a world at rest and moved a little, for :func:`examine`.

    Args:
        world: A world; it is reset and stepped.
        suite: Of the world's task.
    """
    spec = policy.spec
    world.reset(0)
    observations = []
    for move in ((0.3, 0, 0), (0, 0.5, 0), (-0.4, 0, 0.3), (0, -0.5, -0.3)):
        for _ in range(4):
            world.step((*move, 0.0, 0.0, 0.0, -1.0))
        observations.append(world.observe(spec.cameras, spec.image_size))
    episode = Episode(suite, 0, world.language, 195, 220)
    return Shown(episode, tuple(observations))


def _ask(policy: Policy, shown: Shown, index: int, **changed: Any) -> Actions:
    """Return the answer to query ``index``, from a copy of the observation."""
    observation = {key: np.array(value) for key, value in shown.observations[index].items()}
    observation.update(changed.pop("observation", {}))
    return ask(policy, observation, replace(shown.query(index), **changed))


def _answers(policy: Policy, shown: Shown) -> Iterator[Finding]:
    """Report times, ranges, lengths and the gripper over the first queries of an episode."""
    spec = policy.spec
    start(policy, shown.episode)
    seconds, answers = [], []
    for index in range(QUERIES):
        began = time.perf_counter()
        answers.append(_ask(policy, shown, index))
        seconds.append(time.perf_counter() - began)
    later = float(np.median(seconds[1:]))
    per_episode = shown.episode.max_steps / spec.query_interval
    yield ok(
        "latency",
        f"first query {seconds[0]:.3f} s, later ones {later:.3f} s: about {2 * per_episode * later:.0f} s of "
        f"policy for a pair of 2 x {counted(shown.episode.max_steps, 'step')}",
    )
    lengths = sorted({len(answer) for answer in answers})
    if len(lengths) > 1:
        yield doubt(
            "length",
            f"answers of {', '.join(map(str, lengths))} actions",
            "the same number from every query",
            "The chunk drifts: a queue inside the adapter may hand out what is left of it.",
        )
    elif lengths[0] != spec.horizon:
        yield doubt(
            "horizon",
            f"every query returns {counted(lengths[0], 'action')}",
            f"horizon={spec.horizon}, as declared",
            "Declare the H that the model really returns.",
        )
    else:
        yield ok("horizon", f"every query returns H={spec.horizon}; Q={spec.query_interval}")
    everything = np.concatenate(answers)
    if spec.control == "absolute":
        yield _poses([answer[0] for answer in answers], shown)
    else:
        yield _range(everything)
    yield _gripper(
        everything[:, 6], np.concatenate([answer[: spec.query_interval] for answer in answers])[:, 6]
    )


def _range(actions: Actions) -> Finding:
    """Judge movement and rotation, each by its own size; the gripper, -1 or 1, would hide both."""
    movement, rotation = (float(np.abs(actions[:, part]).max()) for part in (slice(0, 3), slice(3, 6)))
    share = float((np.abs(actions[:, :6]) > 1.0).mean())
    sizes = f"movement up to {movement:.3g}, rotation up to {rotation:.3g}"
    if max(movement, rotation) > FAR_BEYOND:
        return wrong(
            "range",
            sizes,
            "movements within [-1, 1]",
            "These are other units: un-normalise the actions, or do not un-normalise them twice. Poses are "
            'declared with PolicySpec(control="absolute").',
        )
    if not actions[:, :6].any():
        return doubt(
            "range",
            "no movement at all",
            "movements",
            "A policy that holds still, or one that got zeros.",
        )
    if movement < LEAST_MOVEMENT:
        return doubt(
            "range",
            sizes,
            f"movements of at least {LEAST_MOVEMENT}, 3 mm a step",
            "Too small to reach anything: metres instead of LIBERO's units (1 is 5 cm), or normalised still.",
        )
    if share > 0.05:
        return doubt(
            "range",
            f"{share:.0%} of the components are beyond 1 and will be clipped",
            "few",
            "Look at the un-normalisation.",
        )
    if 0.0 < rotation < LEAST_ROTATION:
        return note(
            "range",
            sizes,
            f"rotations of at least {LEAST_ROTATION}, or none",
            "Hardly any: right for a policy that never turns the hand, else normalised still (1 is 0.5 rad).",
        )
    return ok("range", f"{sizes}, {share:.0%} of both clipped")


def _poses(actions: list[Actions], shown: Shown) -> Finding:
    """Check the distance to which the first action of each answer sends the hand, under absolute control."""
    hands = [observation["robot0_eef_pos"] for observation in shown.observations[: len(actions)]]
    farthest = float(np.linalg.norm(np.array(actions)[:, :3] - hands, axis=1).max())
    if farthest > FAR_AWAY_M:
        return wrong(
            "range",
            f"the first pose of an answer is up to {farthest:.2g} m from the hand",
            "poses in the world that begin near the hand",
            "These are movements, of another frame, or normalised still.",
        )
    return ok("range", f"poses; the first of an answer is up to {farthest:.2g} m from the hand")


def _gripper(values: NDArray[Any], first: NDArray[Any]) -> Finding:
    """Judge the gripper by all values of it, and by those that would be executed."""
    if np.abs(values).max() > FAR_BEYOND:
        return wrong(
            "gripper",
            f"from {values.min():.3g} to {values.max():.3g}",
            "-1 opens, +1 closes",
            "These are other units: the sign of a centred value is enough.",
        )
    if (
        ((values >= 0.0) & (values <= 1.0)).all()
        and len(set(np.round(values, 6))) <= 2
        and (values == 0.0).any()
    ):
        return wrong(
            "gripper",
            "0 or 1",
            "-1 opens, +1 closes",
            "It is a flag: write 1 - 2 * (g > 0.5) where 1 means open.",
        )
    if ((values >= 0.0) & (values <= 1.0)).all() and not (values == 1.0).all():
        return wrong(
            "gripper",
            f"from {values.min():.2g} to {values.max():.2g}",
            "-1 opens, +1 closes",
            "It is a probability or an opening from 0 to 1: write -sign(2 g - 1) where 1 means open.",
        )
    if (first > 0.0).mean() > 0.9:
        return doubt(
            "gripper",
            "closes at once, far from any object",
            "open (-1) at the beginning of an episode",
            "The sign may be the wrong way round: LIBERO's gripper closes at +1.",
        )
    return ok("gripper", "open at the beginning of the episode, as far as it was asked")


def _repeats(policy: Policy, shown: Shown) -> Iterator[Finding]:
    start(policy, shown.episode)
    first = _ask(policy, shown, 0)
    start(policy, shown.episode)
    second = _ask(policy, shown, 0)
    start(policy, shown.episode)
    reseeded = _ask(policy, shown, 0, seed=shown.query(0).seed ^ 0x5A5A)
    same = first.tobytes() == second.tobytes()
    if not same and policy.spec.repeatable:
        yield wrong(
            "seed",
            "the same first query of an episode got two different answers",
            "the same bytes",
            "It draws from something else than query.seed, or reset() leaves something behind. A server "
            "that cannot be seeded declares repeatable=False.",
        )
    elif not same:
        yield note(
            "seed",
            "the same query got two different answers, and repeatable=False says so",
            mistake="Measure how often Base flips by itself: --libero-max-noise=floor:16.",
        )
    elif first.tobytes() == reseeded.tobytes():
        yield ok("seed", "deterministic: the same answer with another seed as well")
    else:
        yield ok("seed", "the same query gets the same answer, another seed another one")
    if same and not policy.spec.repeatable:
        yield note(
            "repeatable",
            "declared False, but the answer repeated itself",
            mistake="If the server is deterministic, repeatable=True lets every pair check it.",
        )


def _forgets(policy: Policy, shown: Shown) -> Iterator[Finding]:
    """Check that reset removes all traces of an episode, and that answers depend on nothing but the query."""
    if not policy.spec.repeatable:
        yield skip(
            "repeatable",
            "reset, memory, what the answer depends on: repeatable=False, so no two answers can be compared",
        )
        return
    start(policy, shown.episode)
    fresh = _ask(policy, shown, 0)
    for index in range(1, QUERIES):
        _ask(policy, shown, index)
    another = replace(shown.episode, task_index=shown.episode.task_index + 1, seed=shown.episode.seed + 1)
    start(policy, another)
    _ask(policy, shown, 0)
    start(policy, shown.episode)
    if _ask(policy, shown, 0).tobytes() != fresh.tobytes():
        yield wrong(
            "reset",
            "the first answer of an episode depends on the episodes before",
            "a new episode forgets everything",
            "Let reset() empty queues, histories, counters and generators.",
        )
    after = _ask(policy, shown, 1)
    start(policy, shown.episode)
    alone = _ask(policy, shown, 1)
    if after.tobytes() == alone.tobytes():
        yield ok("memory", "an answer depends on its own observation and query alone")
    elif remembers(policy):
        yield ok("memory", "answers depend on earlier queries, and snapshot() is offered")
    elif memory_of(policy) != "none":
        yield ok("memory", "answers depend on earlier queries, as the policy declares")
    else:
        yield wrong(
            "memory",
            "an answer depends on the queries before it",
            "no memory, or snapshot() and restore(memory)",
            "A queue, a history or a generator lives on between queries: empty it, or offer both methods.",
        )


def _writes(policy: Policy, shown: Shown) -> Iterator[Finding]:
    start(policy, shown.episode)
    observation = marked_observation(shown.observations[0])
    before = {key: value.copy() for key, value in observation.items()}
    ask(policy, observation, shown.query(0))
    written = [
        key
        for key, value in before.items()
        if key not in observation or not np.array_equal(value, observation[key])
    ]
    if written:
        yield wrong(
            "observation",
            f"{', '.join(written)} was written to",
            "an observation that stays as it is",
            "Give a copy to helpers that write into their argument, as robosuite's quat2axisangle does.",
        )


def _looks(policy: Policy, shown: Shown) -> Iterator[Finding]:
    """Check that the answer depends on the observation."""
    if not policy.spec.repeatable:
        return
    start(policy, shown.episode)
    first = _ask(policy, shown, 0)
    images = {key: value for key, value in shown.observations[2].items() if key.endswith("_image")}
    rest = {key: value for key, value in shown.observations[2].items() if key not in images}
    changes: list[tuple[str, dict[str, Any]]] = [
        ("the state", {"observation": rest}),
        ("the instruction", {"instruction": "turn off the light and close the door"}),
    ]
    changes += [(key, {"observation": {key: 255 - images[key]}}) for key in images]
    ignored = []
    for name, change in changes:
        start(policy, shown.episode)
        if _ask(policy, shown, 0, **change).tobytes() == first.tobytes():
            ignored.append(name)
    if len(ignored) == len(changes):
        yield wrong(
            "observation",
            "the answer stays the same whatever is shown",
            "an answer to the observation",
            "An old chunk is returned, or the model is not asked.",
        )
    elif ignored:
        report = note if ignored == ["the state"] else doubt  # many models have no state
        yield report(
            "observation",
            f"the answer does not depend on {', '.join(ignored)}",
            mistake="If the model reads it, it does not arrive there.",
        )
    else:
        yield ok("observation", "the answer depends on every image, the state and the instruction")


def _carries(policy: Policy, shown: Shown) -> Iterator[Finding]:
    if not remembers(policy) or not policy.spec.repeatable:
        return
    start(policy, shown.episode)
    _ask(policy, shown, 0)
    memory = copy_memory(policy)
    first = _ask(policy, shown, 1)
    _ask(policy, shown, 2)
    for _ in range(2):
        restore_memory(policy, memory)
        if _ask(policy, shown, 1).tobytes() != first.tobytes():
            yield wrong(
                "snapshot",
                "after restore(), the same query got another answer",
                "the memory that snapshot() copied",
                "Let snapshot() copy all that answers depend on (copy.deepcopy), and restore() copy from it.",
            )
            return
    yield ok("snapshot", "restore() brings back what snapshot() copied")


def _batches(policy: Policy, shown: Shown) -> Iterator[Finding]:
    """Check that an answer does not depend on the other queries of its batch."""
    if not batches(policy) or remembers(policy) or not policy.spec.repeatable:
        return
    alone, items = [], []
    for index in range(QUERIES):
        start(policy, shown.episode)
        alone.append(_ask(policy, shown, index))
        observation = {key: np.array(value) for key, value in shown.observations[index].items()}
        items.append(BatchItem(observation, shown.query(index), shown.episode))
    together = ask_together(policy, items)
    turned = ask_together(policy, items[::-1])[::-1]
    padded = [ask_together(policy, [item] * QUERIES)[0] for item in items]
    every = [*zip(alone, together, strict=True), *zip(alone, turned, strict=True)]
    if any(one.shape != other.shape or np.abs(one - other).max() > MIXED_UP for one, other in every):
        yield wrong(
            "batch",
            "predict_batch gives other answers than predict",
            "the answer that each query gets alone, in the order of the items",
            "The items are mixed up, or something is shared among them.",
        )
        return
    if all(one.tobytes() == other.tobytes() for one, other in every):
        yield ok("batch", "the same bytes alone and in a batch")
        return
    furthest = max(float(np.abs(one - other).max()) for one, other in every)
    same_size = zip(together, turned, padded, strict=True)
    if all(len({answer.tobytes() for answer in answers}) == 1 for answers in same_size):
        observed = f"answers change by up to {furthest:.1g} with the size of the batch alone"
        mistake = "Serve it with --pad-batch to get the same bytes whoever else asks."
    else:
        observed = (
            f"answers change by up to {furthest:.1g} with the other queries of the batch, "
            "also at the same size"
        )
        mistake = "Serve it without --max-batch, or declare repeatable=False."
    yield note("batch", observed, "the same bytes alone and in a batch", mistake)


def _follows_h(policy: Policy, shown: Shown) -> Iterator[Finding]:
    """Check that a smaller H gives the first actions of the chunk."""
    spec = policy.spec
    if spec.horizon == spec.query_interval or not spec.repeatable:
        return
    start(policy, shown.episode)
    whole = _ask(policy, shown, 0)
    try:
        policy.spec = replace(spec, horizon=spec.query_interval)
    except AttributeError:
        return
    try:
        start(policy, shown.episode)
        with _unheard():
            part = _ask(policy, shown, 0)
    except LiberoMaxError:
        yield note(
            "horizon",
            f"--libero-max-horizon={spec.query_interval} is not followed",
            mistake="Return actions[: self.spec.horizon].",
        )
        return
    finally:
        policy.spec = spec
    count = len(part)
    if part.tobytes() == whole[:count].tobytes():
        yield ok("prefix", "a smaller H gives the first actions of the chunk")
    elif part.tobytes() == whole[-count:].tobytes():
        yield wrong(
            "prefix",
            "a smaller H gives the last actions of the chunk",
            "the first ones",
            "A deque with maxlen keeps its last entries: cut the chunk with [:n] before.",
        )


@contextmanager
def _unheard() -> Iterator[None]:
    """Silence the server's log: refusals provoked here are reported as findings."""
    SERVER_LOG.disabled = True
    try:
        yield
    finally:
        SERVER_LOG.disabled = False


def _inputs(policy: Policy, shown: Shown) -> Iterator[Finding]:
    observation, query = marked_observation(shown.observations[0]), shown.query(0)
    start(policy, shown.episode)
    inputs = model_inputs(policy, observation, query)
    if inputs is None:
        yield skip(
            "inputs",
            f"{', '.join(INPUTS)}: the policy does not tell what its model is shown",
            mistake="Offer model_inputs(observation, query), a mapping of names to the arrays that predict "
            "hands to the model.",
        )
        return
    yield from compare_inputs(inputs, observation)
