"""The stage of an episode: case, world, policy and clock, which go together wherever an arm is played."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes.base import Change, Evidence
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.changes.registry import change_from_dict
from pytest_libero_max.errors import AdapterError, ProtocolError
from pytest_libero_max.pairing.clock import Clock
from pytest_libero_max.pairing.watch import NO_WATCH, Watch
from pytest_libero_max.policies.check import Actions, ask, notes_of, require_spec, show, start
from pytest_libero_max.policies.contract import Episode, Policy, PolicySpec, Query, query_seed
from pytest_libero_max.worlds.contract import (
    NOOP_ACTION,
    Control,
    ImageSize,
    Observation,
    World,
    WorldState,
)

_CURE = "A policy acts through the actions it returns. Plan on a copy of the model and data instead."


WAITED = "server_waited_s"
"""Among the timings of a pair: how long an interrupted policy server was waited for. Only where it was."""

BATCH = "server_batch"
"""Among the timings: the most queries that a policy server answered together. Only where it was several."""


@dataclass(frozen=True)
class Answer:
    """One query of a rollout and all that it returned, executed or not.

    Attributes:
        index: Number of the query in the episode, from 0.
        step: Policy steps executed before it.
        actions: (n, 7), Q <= n <= H.
        notes: What a wrapper around the policy counted at the query, by name; None where it counts nothing.
    """

    index: int
    step: int
    actions: Actions
    notes: Mapping[str, int] | None = None

    @property
    def is_asked(self) -> bool:
        """Whether the policy was asked; a wrapper may have looked, and gone on with an earlier answer."""
        return self.notes is None or bool(self.notes.get("asked", 1))


@dataclass(frozen=True)
class Stage:
    """What an arm is played with.

    Attributes:
        case: What is played.
        world: A world of the case's scene.
        policy: A checked policy.
        clock: Adds up wall-clock seconds.
        watch: Told what begins.
        spec: A copy of the policy's spec, which must stay what it is.
    """

    case: Case
    world: World
    policy: Policy
    clock: Clock = field(default_factory=Clock)
    watch: Watch = NO_WATCH
    spec: PolicySpec = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "spec", replace(self.policy.spec))

    @property
    def entity(self) -> str:
        """The trigger entity of the case, which is followed through every arm."""
        return self.case.event.trigger.entity

    @property
    def instruction(self) -> str:
        """What the policy is told to do: the manifest's prompt, or the task's where it fixes none."""
        return self.world.language if self.case.instruction is None else self.case.instruction

    def begin_world(self) -> None:
        """Reset to the case's initial state, apply the setup that all arms share, settle for ten no-op steps.

        The control that the policy declares begins after them.

        Raises:
            SubstrateError: The scene has no such initial state.
            ChangeError: The setup does not fit this world.
            SimulatorError: The scene does not settle.
        """
        self.watch.step()
        with self.clock("reset_s"):
            begin_world(self.case, self.world, self.spec.control)

    def begin_policy(self) -> None:
        """Tell the policy that an episode begins; a privileged one gets the live world.

        Raises:
            AdapterError: It raised, or altered the world or its spec.
        """
        case, privileged = self.case, self.spec.privileged
        episode = Episode(
            suite=case.suite,
            task_index=case.task_index,
            instruction=self.instruction,
            seed=case.policy_seed,
            max_steps=case.budget,
            world=self.world if privileged else None,
        )
        with self._policy_acts("reset"):
            start(self.policy, episode)

    def require_untouched(self) -> None:
        """Refuse an arm during which a fixed field of the model or its options was written.

        The write is undone, so that the next arm or pair finds the scene as it was built.

        Raises:
            AdapterError: The policy wrote one; names the fields.
        """
        written = self.world.take_back_writes()
        if written:
            raise AdapterError(
                f"policy {self.spec.name!r} wrote {', '.join(written)} of the world's model, but "
                f"episode.world is read only. {_CURE}"
            )

    def ask(self, index: int, step: int) -> Answer:
        """Show the policy the world as it is now and return its checked answer.

        Images are rendered for a policy here and in :meth:`show` alone, and only of the cameras and in the
        size that the policy declares.

        Args:
            index: Number of the query in the episode, from 0.
            step: Policy steps executed before it.

        Raises:
            ActionError: The actions cannot be played.
            AdapterError: The policy raised, or altered the world or its spec, which are read only for it.
            SimulatorError: The renderer does not answer.
        """
        query = Query(index, step, self.instruction, query_seed(self.case.policy_seed, index))
        observation, waited_s = self._observed(), self._waited_s()
        with self._policy_acts(f"predict, query {index} at step {step}"):
            actions = ask(self.policy, observation, query)
        if self._waited_s() > waited_s:
            self.clock.add(WAITED, self._waited_s() - waited_s)
        if (batch := int(getattr(self.policy, "batch_size", 1))) > 1:
            self.clock.note_largest(BATCH, batch)
        for name, seconds in getattr(self.policy, "query_seconds", {}).items():
            self.clock.add(name, seconds)
        # The numbers are ours: the policy has had the query in its hands.
        return Answer(index, step, actions, notes_of(self.policy))

    def show(self, step: int) -> None:
        """Show the world as it is to a policy that is shown every step, where it is not asked.

        Args:
            step: Policy steps executed before it.

        Raises:
            AdapterError: The policy raised, or altered the world or its spec, which are read only for it.
            SimulatorError: The renderer does not answer.
        """
        observation = self._observed()
        with self._policy_acts(f"see, step {step}"):
            show(self.policy, observation, step)

    def _observed(self) -> Observation:
        """What the policy is shown of the world as it is now."""
        self.watch.step()
        with self.clock("observe_s"):
            return self.world.observe(self.spec.cameras, self.spec.image_size)

    @contextmanager
    def _policy_acts(self, where: str) -> Iterator[None]:
        """The block calls the policy, which must leave the world and its own spec as they are.

        Args:
            where: What it is called for, for a message.
        """
        before = self._seen_by_policy()
        self.watch.query()
        with self.clock("policy_s"):
            yield
        self.watch.step()
        require_spec(self.policy, self.spec, where)
        self._require_unaltered(before, where)

    def _waited_s(self) -> float:
        """How long a policy behind a server has waited for it to come back, s; 0 for every other policy."""
        return float(getattr(self.policy, "waited_s", 0.0))

    def _seen_by_policy(self) -> WorldState | None:
        """The world before a privileged policy sees it; None for the others, which never do."""
        return self.world.snapshot() if self.spec.privileged else None

    def _require_unaltered(self, before: WorldState | None, where: str) -> None:
        altered = () if before is None else before.differing(self.world.snapshot())
        if altered:
            raise AdapterError(
                f"policy {self.spec.name!r} altered the world in {where}, but episode.world is read only. "
                f"What differs: {', '.join(altered)}. {_CURE}"
            )


def begin_world(case: Case, world: World, control: Control = "delta") -> None:
    """Bring a world to where the policy takes over; see :meth:`Stage.begin_world`."""
    world.reset(case.init_state_index)
    for change in case.event.setup:
        change_from_dict(change).apply(world)
    for _ in range(SETTLE_STEPS):
        world.step(NOOP_ACTION)
    world.set_control(control)


@dataclass(frozen=True)
class Applied:
    """A change that has happened.

    Attributes:
        change: The change.
        evidence: What it found and left.
        pixel_change: For each camera that was looked through, the mean absolute difference of its images
            before and after, 0 to 255.
    """

    change: Change
    evidence: Evidence
    pixel_change: dict[str, float]

    def to_dict(self) -> Json:
        """The evidence and the change of pixels as JSON values."""
        return {**self.evidence.to_dict(), "pixel_change": dict(self.pixel_change)}


def apply_change(change: Change, world: World, spec: PolicySpec | None, item_id: str) -> Applied:
    """Apply a change to the world now, once, and measure what it did.

    Args:
        change: What to do.
        world: To what.
        spec: Whose cameras to measure the change of pixels in. None: nothing is rendered.
        item_id: The case, for messages.

    Raises:
        ProtocolError: The change left the world bit for bit as it was.
        ChangeError: It does not fit this world.
    """
    cameras, size = (spec.cameras, spec.image_size) if spec else ((), 1)
    images = _look(world, cameras, size)
    before = world.digest()
    evidence = change.apply(world)
    if world.digest() == before and not isinstance(change, Nothing):
        raise ProtocolError(
            f"{item_id}: {change.operation} left the world bit for bit as it was, so the arm would equal the "
            "one without it. Its parameters describe no change; repair the manifest."
        )
    return Applied(
        change,
        evidence,
        {
            camera: float(np.abs(image.astype(np.int16) - images[camera]).mean())
            for camera, image in _look(world, cameras, size).items()
        },
    )


def _look(world: World, cameras: tuple[str, ...], size: ImageSize) -> dict[str, NDArray[Any]]:
    if not cameras:
        return {}
    observation = world.observe(cameras, size)
    return {camera: observation[f"{camera}_image"] for camera in cameras}
