"""The pair runner: Base once, back to the event, the change, Dynamic, the record.

:func:`play_pair` does all of it. Its pieces, for a test of your own: :func:`play_prefix` plays a case up to
its event, :func:`inject` makes the change, :func:`continue_rollout` plays on, :func:`return_to` goes back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.changes.registry import change_from_dict
from pytest_libero_max.errors import ProtocolError
from pytest_libero_max.events.registry import family_of
from pytest_libero_max.pairing.clock import Clock
from pytest_libero_max.pairing.episode import instruction_of
from pytest_libero_max.pairing.prefix import BranchPoint, PrefixMode, return_to
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.rollout import Rollout, RolloutResult
from pytest_libero_max.policies.contract import Policy, PolicySpec
from pytest_libero_max.worlds.contract import World

Phase = Literal["setup", "base", "dynamic"]


@dataclass(frozen=True)
class PairSettings:
    """How pairs are played. Nothing here may change what is measured.

    Attributes:
        prefix: How Dynamic gets to the event; see :func:`return_to`.
        fingerprints: What could change a result, for the record: versions, substrate, assets.
    """

    prefix: PrefixMode = "fork"
    fingerprints: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Pair:
    """A measured pair with its trajectories.

    Attributes:
        record: What is kept of it.
        base: The Base rollout.
        dynamic: The Dynamic rollout; None where the event never fired.
    """

    record: PairRecord
    base: RolloutResult
    dynamic: RolloutResult | None


def play_pair(
    case: Case,
    world: World,
    policy: Policy,
    settings: PairSettings | None = None,
    on_phase: Callable[[Phase], None] | None = None,
) -> PairRecord:
    """Measure one pair; see :func:`measure_pair`, which returns the trajectories as well."""
    return measure_pair(case, world, policy, settings, on_phase).record


def measure_pair(
    case: Case,
    world: World,
    policy: Policy,
    settings: PairSettings | None = None,
    on_phase: Callable[[Phase], None] | None = None,
) -> Pair:
    """Play Base to its end, return to the event, apply it, and play Dynamic to its end.

    Where the event never fires, Dynamic would execute the same actions in the same world from the first step
    to the last, and the simulation is a function of those: its outcome is that of Base, and it is not played.

    Args:
        case: What to play.
        world: A world of the case's scene; what it was doing before leaves no trace.
        policy: A checked policy.
        settings: How to play.
        on_phase: Told when ``setup``, ``base`` and ``dynamic`` begin, so that an error can be placed.

    Raises:
        AdapterError: The policy broke its contract.
        ProtocolError: The two rollouts do not share their prefix, or the event altered nothing.
        SimulatorError: The simulation broke.
        SubstrateError: The world cannot start this case.
        ChangeError: The setup or the event does not fit this world.
    """
    settings = PairSettings() if settings is None else settings
    enter = on_phase or _ignore
    clock = Clock()
    enter("setup")
    rollout = Rollout.start(case, world, policy, clock)
    enter("base")
    with clock("base_s"):
        branch = rollout.advance_to_trigger()
        base = rollout.advance_to_end()
    dynamic, evidence = None, None
    if branch is not None:
        enter("dynamic")
        with clock("prefix_s"):
            return_to(branch, case, world, policy, settings.prefix, clock)
        with clock("event_s"):
            evidence = inject(case, world, policy.spec)
        with clock("dynamic_s"):
            dynamic = Rollout.resume(branch, case, world, policy, clock).advance_to_end()
    record = _record(
        case, world, policy, settings, rollout.min_distance_m, branch, evidence, base, dynamic, clock
    )
    return Pair(record, base, dynamic)


def with_base_repeated(pair: Pair, case: Case, world: World, policy: Policy) -> Pair:
    """Play Base once more and note in the record whether it ended alike: the noise below every effect.

    The arguments and errors are those of :func:`measure_pair`.
    """
    again = Rollout.start(case, world, policy, Clock()).advance_to_end()
    repeat = {"success": again.success, "identical": again.proof == pair.base.proof}
    return replace(pair, record=replace(pair.record, base_repeat=repeat))


def play_prefix(case: Case, world: World, policy: Policy) -> BranchPoint | None:
    """Play a case up to its event, which is not applied; None where the episode ends without it.

    World and policy are left at the branch point. The arguments and errors are those of :func:`measure_pair`.
    """
    return Rollout.start(case, world, policy, Clock()).advance_to_trigger()


def inject(case: Case, world: World, spec: PolicySpec | None = None) -> Json:
    """Apply the case's event to the world now, once, and say what it did.

    Args:
        case: The case.
        world: Its world, at the branch point.
        spec: Whose cameras to measure the change of pixels in. None: nothing is rendered.

    Returns:
        The change's evidence (see :class:`pytest_libero_max.changes.base.Evidence`) with ``pixel_change``,
        the mean absolute difference of each of those cameras' images, 0 to 255.

    Raises:
        ProtocolError: The event left the world bit for bit as it was.
        ChangeError: It does not fit this world.
    """
    change = change_from_dict(case.event.change)
    cameras, size = (spec.cameras, spec.image_size) if spec else ((), 1)
    images = _look(world, cameras, size)
    before = world.digest()
    evidence = change.apply(world).to_dict()
    if world.digest() == before and not isinstance(change, Nothing):
        raise ProtocolError(
            f"{case.item_id}: {change.operation} left the world bit for bit as it was, so Dynamic would be "
            "Base. Its parameters describe no change; repair the manifest."
        )
    evidence["pixel_change"] = {
        camera: float(np.abs(image.astype(np.int16) - images[camera]).mean())
        for camera, image in _look(world, cameras, size).items()
    }
    return evidence


def continue_rollout(branch: BranchPoint, case: Case, world: World, policy: Policy) -> RolloutResult:
    """Play on from a branch point to the end of the episode: queued actions first, then queries.

    World and policy are where :func:`play_prefix` or :func:`return_to` left them, or altered since by
    :func:`inject` or any other change. The errors are those of :func:`measure_pair`.
    """
    return Rollout.resume(branch, case, world, policy, Clock()).advance_to_end()


def _look(world: World, cameras: tuple[str, ...], size: int) -> dict[str, NDArray[Any]]:
    if not cameras:
        return {}
    observation = world.observe(cameras, size)
    return {camera: observation[f"{camera}_image"] for camera in cameras}


def _ignore(phase: Phase) -> None:
    """Nobody wants to know."""


def _record(
    case: Case,
    world: World,
    policy: Policy,
    settings: PairSettings,
    min_distance_m: float,
    branch: BranchPoint | None,
    evidence: Json | None,
    base: RolloutResult,
    dynamic: RolloutResult | None,
    clock: Clock,
) -> PairRecord:
    second = base if dynamic is None else dynamic
    response_step, stale_actions, dynamic_queries = None, None, 0
    if branch is not None:
        after = second.answers[len(branch.answers) :]
        response_step = after[0].step if after else None
        stale_actions = (second.steps if response_step is None else response_step) - branch.step
        dynamic_queries = len(after)
    return PairRecord(
        case_id=case.case_id,
        item_id=case.item_id,
        case_digest=case.digest,
        source=case.source,
        source_category=case.source_category,
        difficulty=case.difficulty,
        suite=case.suite,
        task_index=case.task_index,
        init_state_index=case.init_state_index,
        policy_seed=case.policy_seed,
        instruction=instruction_of(case, world),
        event=case.event.name,
        family=family_of(case.event.name),
        variant=case.event.variant,
        severity=case.event.severity,
        trigger_entity=case.event.trigger.entity,
        base_success=base.success,
        dynamic_success=second.success,
        base_steps=base.steps,
        dynamic_steps=second.steps,
        max_steps=case.budget,
        trigger_step=branch.step if branch else None,
        trigger_distance_m=branch.distance_m if branch else None,
        min_distance_m=min_distance_m,
        response_step=response_step,
        stale_actions=stale_actions,
        base_queries=len(base.answers),
        dynamic_queries=dynamic_queries,
        prefix_digest=branch.proof if branch else None,
        base_digest=base.proof,
        dynamic_digest=dynamic.proof if dynamic else None,
        evidence=evidence,
        contacts={"base": list(base.contacts), "dynamic": list(second.contacts)},
        policy=policy.spec.to_dict(),
        fingerprints=dict(settings.fingerprints),
        timings=clock.seconds,
    )
