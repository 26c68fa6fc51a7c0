"""The stage of an episode: case, world, policy and clock, which go together wherever an arm is played."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import AdapterError, ProbeError, RefusalError
from pytest_libero_max.pairing.changing import begin_world
from pytest_libero_max.pairing.kept_images import KeptImages
from pytest_libero_max.pairing.probes.probe import Probes
from pytest_libero_max.pairing.probes.standard import STANDARD
from pytest_libero_max.pairing.trajectory import QueryResult
from pytest_libero_max.pairing.wall_clock import NO_WATCH, Clock, Watch
from pytest_libero_max.policies.check import ask, notes_of, require_spec, show, start
from pytest_libero_max.policies.contract import Episode, Handover, Policy, PolicySpec, Query, query_seed
from pytest_libero_max.worlds.contract import Observation, PosedWorld, World, WorldState

_CURE = "A policy acts through the actions it returns. Plan on a copy of the model and data instead."


WAITED = "server_waited_s"
"""Among the timings of a pair: how long an interrupted policy server was waited for. Only where it was."""

BATCH = "server_batch"
"""Among the timings: the most queries that a policy server answered together. Only where it was several."""


@dataclass(frozen=True)
class Stage:
    """Case, world, policy and clock of an arm."""

    case: Case
    world: World
    policy: Policy
    clock: Clock = field(default_factory=Clock)
    watch: Watch = NO_WATCH
    """Notified of each call that may take too long."""
    probes: Probes = STANDARD
    films: bool = False
    """True if the positions of all joints are kept, for films."""
    handover: Handover | None = None
    """What the policy is given of the rollout so far, where it takes over from another one."""
    spec: PolicySpec = field(init=False)
    """A copy of the policy's spec, which must stay the same."""
    images: KeptImages = field(init=False, default_factory=KeptImages, repr=False)
    """The images of the arms, each of which is drawn once."""
    _words_at_reset: list[str | None] = field(init=False, default_factory=list, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "films", self.films and isinstance(self.world, PosedWorld))
        object.__setattr__(self, "spec", replace(self.policy.spec))
        if self.spec.robot not in (None, self.world.robot.name):
            raise AdapterError(
                f"policy {self.spec.name!r} is for robot={self.spec.robot!r}, but {self.world.scene} has "
                f"{self.world.robot.name!r}. Play it on a substrate with its robot, or declare the one that "
                "it drives: PolicySpec(robot=...)."
            )

    def handed_to(self, policy: Policy, handover: Handover | None) -> Stage:
        """Return the stage on which another policy goes on in the world as it is, or raise AdapterError.

        Args:
            policy: The policy, to which an episode begins here.
            handover: What it is given of the rollout so far; None where that has no step, so that the first
                query begins its episode.
        """
        if policy.spec.control != self.spec.control:
            raise AdapterError(
                f"policy {policy.spec.name!r} has control={policy.spec.control!r}, but goes on from "
                f"{self.spec.name!r} with {self.spec.control!r}. Play arms of one control."
            )
        stage = replace(self, policy=policy, handover=handover)
        stage._words_at_reset[:] = self._words_at_reset
        if handover is not None:
            stage.begin_policy()
        return stage

    @property
    def entity(self) -> str:
        """The trigger entity of the case, which is followed through every arm."""
        return self.case.event.entity

    @property
    def instruction(self) -> str:
        """Instruction of the policy: the manifest's prompt, or the task's where it fixes none.

        An instruction that a change gave since the episode began replaces both.
        """
        words, own = self.world.language, self.case.instruction
        return words if own is None or self._words_at_reset not in ([], [words]) else own

    def joints(self) -> NDArray[np.float32] | None:
        """Return the positions of all joints now; None where no film is to be made."""
        if not self.films:
            return None
        return cast("PosedWorld", self.world).posture()

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
        self.begun_with(self.world.language)

    def begun_with(self, words: str | None) -> None:
        """Keep the world's instruction when the episode began; None: it is another one by now."""
        self._words_at_reset[:] = [words]

    @property
    def episode(self) -> Episode:
        """Return the episode for the policy; a privileged one gets the live world."""
        return Episode(
            suite=self.case.suite,
            task_index=self.case.task_index,
            instruction=self.instruction,
            seed=self.case.policy_seed,
            max_steps=self.case.budget,
            robot=self.world.robot,
            world=self.world if self.spec.privileged else None,
            handover=self.handover,
        )

    def begin_policy(self) -> None:
        """Tell the policy that an episode begins, or raise AdapterError or RefusalError."""
        with self._policy_acts("reset"):
            start(self.policy, self.episode)

    def require_untouched(self) -> None:
        """Refuse an arm during which a fixed field of the model or its options was written.

        The write is undone, so that the next arm or pair finds the scene as it was built.

        Raises:
            RefusalError: The policy wrote one; names the fields.
            ProbeError: A probe did, or one of several that had the world in their hands; names them.
        """
        written = self.world.take_back_writes()
        if not written:
            return
        policy, fields = f"policy {self.spec.name!r}", f"{', '.join(written)} of the world's model"
        if not self.probes.names:
            raise RefusalError(f"{policy} wrote {fields}, but episode.world is read only. {_CURE}")
        suspects = [f"probe {name!r}" for name in self.probes.names]
        suspects += [policy] if self.spec.privileged else []
        raise ProbeError(
            f"{' or '.join(suspects)} wrote {fields}, but a world is read only for them. "
            + ("Play without one of them to see which it was." if suspects[1:] else "Repair the probe.")
        )

    def query(self, index: int, step: int, reseeds: int = 0) -> Query:
        """Return the query of that number, from 0, after so many policy steps and new seeds."""
        return Query(index, step, self.instruction, query_seed(self.case.policy_seed, index, reseeds))

    def ask(self, query: Query) -> QueryResult:
        """Show the policy the world as it is now and return its checked answer.

        Images are rendered for a policy in :meth:`observed` alone, for a query and for :meth:`show`, and only
        of the cameras and in the size that the policy declares.

        Raises:
            ActionError: The actions cannot be played.
            AdapterError: The policy raised.
            RefusalError: It altered the world or its spec, which are read only for it.
            SimulatorError: The renderer does not answer.
        """
        index, step = query.index, query.step
        observation, waited_s = self.observed(), self._waited_s()
        with self._policy_acts(f"predict, query {index} at step {step}"):
            begin = perf_counter()
            actions = ask(self.policy, observation, query)
            took = perf_counter() - begin
        if self._waited_s() > waited_s:
            self.clock.add(WAITED, self._waited_s() - waited_s)
        if (batch := int(getattr(self.policy, "batch_size", 1))) > 1:
            self.clock.note_largest(BATCH, batch)
        for name, seconds in getattr(self.policy, "query_seconds", {}).items():
            self.clock.add(name, seconds)
        # The numbers are ours: the policy has had the query in its hands.
        returned = getattr(self.policy, "returned", None)
        returned = returned if type(returned) is int and returned > 0 else None
        return QueryResult(index, step, actions, notes_of(self.policy), returned=returned, seconds=took)

    def show(self, step: int) -> None:
        """Show the world as it is to a policy that is shown every step, where it is not asked.

        Raises:
            AdapterError: The policy raised.
            RefusalError: It altered the world or its spec, which are read only for it.
            SimulatorError: The renderer does not answer.
        """
        observation = self.observed()
        with self._policy_acts(f"see, step {step}"):
            show(self.policy, observation, step)

    def observed(self) -> Observation:
        """Return the observation of the world as it is now."""
        self.watch.step()
        with self.clock("observe_s"):
            return self.images.observe(self.world, self.spec.cameras, self.spec.image_size)

    @contextmanager
    def _policy_acts(self, where: str) -> Iterator[None]:
        """Call the policy in the block, which must leave the world and the policy's spec unchanged."""
        before, digest = self._seen_by_policy(), self.world.digest()
        self.watch.query()
        with self.clock("policy_s"):
            yield
        self.watch.step()
        require_spec(self.policy, self.spec, where)
        if self.world.digest() != digest:
            self._require_unaltered(before, where)
            raise RefusalError(  # a policy that is given no world may have found it
                f"the world was altered while policy {self.spec.name!r} was called ({where}). {_CURE}"
            )

    def _waited_s(self) -> float:
        """Seconds that a policy behind a server has waited for it to come back; 0 for every other policy."""
        return float(getattr(self.policy, "waited_s", 0.0))

    def _seen_by_policy(self) -> WorldState | None:
        """State of the world before a privileged policy sees it; None for the others, which never do."""
        return self.world.snapshot() if self.spec.privileged else None

    def _require_unaltered(self, before: WorldState | None, where: str) -> None:
        altered = () if before is None else before.differing(self.world.snapshot())
        if altered:
            raise RefusalError(
                f"policy {self.spec.name!r} altered the world in {where}, but episode.world is read only. "
                f"What differs: {', '.join(altered)}. {_CURE}"
            )
