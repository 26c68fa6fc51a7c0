"""One arm of a case as an environment for other people's loops: Gymnasium's ``reset`` and ``step``.

Gymnasium need not be installed. The environment has no spaces and no vector form, which
:mod:`pytest_libero_max.gym` adds; it is the rollout that the runner plays, given one action at a time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ActionError, AdapterError, ProtocolError
from pytest_libero_max.events.schedules import BASE, Arm
from pytest_libero_max.pairing.probes.probe import Probes
from pytest_libero_max.pairing.probes.standard import STANDARD
from pytest_libero_max.pairing.rollout import Rollout, RolloutResult
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.check import check_actions
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import Observation, World

Info = dict[str, Any]


class _Outside:
    """The policy of a stage whose queries are answered from outside."""

    def __init__(self, spec: PolicySpec) -> None:
        self.spec = spec

    def reset(self, episode: Episode) -> None:
        """Do nothing: the policy is outside."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        """Refuse: the actions come from outside.

        Raises:
            AdapterError: Always.
        """
        raise AdapterError("the actions of an environment come from its step(action), not from a policy.")


_ANY = PolicySpec("outside")


class ArmEnv:
    """An arm of a case that is stepped from outside, shaped like ``gymnasium.Env``.

    The actions lead to the states, the proof and the results of the same actions in the runner. With the
    result of ``base`` the arm has the executed prefix of Base: until its first event, Base's actions are
    executed and proved to lead to Base's states, and the given ones are compared with them.

    Args:
        case: The case.
        world: A world of its scene, in any state.
        arm: The arm; Base unless given.
        spec: Cameras, image size and control, and the ``query_interval`` Q (execution horizon, replan steps)
            at which whoever steps it asks the policy, from the first step on.
        probes: The probes that read it.
        base: The ended Base rollout of the case.

    Attributes:
        differing: Steps of the executed prefix at which another action was given than Base executed.

    Raises:
        AdapterError: The arm has a latency or a policy.
    """

    metadata: Mapping[str, Any] = {"render_modes": []}
    render_mode = None

    def __init__(
        self,
        case: Case,
        world: World,
        arm: Arm | None = None,
        spec: PolicySpec = _ANY,
        probes: Probes = STANDARD,
        base: RolloutResult | None = None,
    ) -> None:
        self._arm = Arm(BASE) if arm is None else arm
        if self._arm.is_late or self._arm.policy is not None:
            what = "latency" if self._arm.is_late else "policy"
            raise AdapterError(
                f"arm {self._arm.name!r} has a {what}, but whoever steps an environment decides what "
                f"is done, and when. Leave the {what} out."
            )
        self._stage = Stage(case, world, _Outside(replace(spec, repeatable=False)), probes=probes)
        self._base = base
        self.differing: list[int] = []
        self._rollout: Rollout | None = None
        self._result: RolloutResult | None = None

    @property
    def result(self) -> RolloutResult:
        """The episode that has ended, with the columns of the probes.

        Raises:
            ProtocolError: It has not ended.
        """
        if self._result is None:
            raise ProtocolError("the episode has not ended. Step until `terminated` or `truncated` is true.")
        return self._result

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begin the episode: initial state, setup, settle steps, changes at the start.

        Args:
            seed: Ignored: the case fixes everything.
            options: Ignored.

        Returns:
            LIBERO's observation, and the info of :meth:`step`.

        Raises:
            ProtocolError: The episode begins in another state than Base.
        """
        self._result = None
        self.differing = []
        self._rollout = Rollout.start(self._stage, (self._arm,))
        if self._base is not None and self._rollout.trajectory.first != self._base.trajectory.first:
            raise self._elsewhere(0)
        self._rollout.let_happen()
        return self._rollout.observed(), self._info(self._rollout, 0)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, Info]:
        """Execute one action, and the entries of the schedule that fire after it.

        Args:
            action: (7,) a movement or a pose, as ``control`` says.

        Returns:
            The observation; 1.0 where the task is completed, else 0.0; whether it is completed; whether the
            budget is spent; and an info with ``step`` (policy steps executed), ``instruction``, ``proof``
            (hash chain, hexadecimal), ``events`` (what happened after the action: policy ``step``,
            ``distance_m``, ``prefix_proof`` and ``evidence``) and, at the end, ``probes``.

        Raises:
            ActionError: The action cannot be played.
            ProtocolError: The episode has not begun, or has ended; or an action of the executed prefix led to
                another state than in Base.
        """
        rollout = self._rollout
        if rollout is None or self._result is not None:
            raise ProtocolError("no episode is running. Call reset() first.")
        fired = len(rollout.trajectory.firings)
        try:
            given = check_actions(action, replace(self._stage.spec, horizon=1, query_interval=1))
        except ActionError as error:
            raise error.within(f"step {rollout.trajectory.step}") from error
        shared = self._base is not None and not fired
        rollout.execute(self._of_base(rollout.trajectory.step, given) if shared else given[0])
        if shared:
            self._require_shared(rollout)
        rollout.let_happen()
        if not rollout.running:
            self._result = rollout.result()
            self._stage.require_untouched()
        done, success = self._result is not None, rollout.success
        info = self._info(rollout, fired)
        return rollout.observed(), float(success), success, done and not success, info

    def close(self) -> None:
        """Do nothing: the world belongs to the caller."""

    def _of_base(self, step: int, given: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (7,) action that Base executed, after comparing it with the given one."""
        assert self._base is not None
        executed = self._base.trajectory.executed[step].action
        if given.tobytes() != executed.tobytes():
            self.differing.append(step)
        return executed

    def _require_shared(self, rollout: Rollout) -> None:
        assert self._base is not None
        step = rollout.trajectory.step
        if rollout.trajectory.link != self._base.trajectory.executed[step - 1].link:
            raise self._elsewhere(step)

    def _elsewhere(self, step: int) -> ProtocolError:
        return ProtocolError(
            f"{self._stage.case.item_id}: after step {step} of the executed prefix the world of arm "
            f"{self._arm.name!r} is another than in Base, so the arms are not comparable. The simulation "
            "does not repeat itself on this machine, or something else writes to the world."
        )

    def _info(self, rollout: Rollout, fired: int) -> Info:
        trajectory = rollout.trajectory
        events = [
            {
                "step": firing.step,
                "distance_m": firing.distance_m,
                "prefix_proof": firing.proof,
                "evidence": firing.applied.to_dict(),
            }
            for firing in trajectory.firings[fired:]
        ]
        return {
            "step": trajectory.step,
            "instruction": self._stage.instruction,
            "proof": trajectory.proof,
            "events": events,
            **({} if self._result is None else {"probes": self._result.probes}),
        }
