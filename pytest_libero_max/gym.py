"""Gymnasium environments of the pairs of a run, for evaluation loops of others; the extra ``gym``.

A run hands out an environment for each case and arm, and writes the record of a pair when both arms have
ended, into a ``pairs.jsonl`` that ``libero-max report``, ``compare`` and ``gate`` read. With ``traces``
``libero-max film`` makes films of it::

    run = PairedRun("results", PolicySpec("my_policy", horizon=10, query_interval=5), "lite", limit=100)
    for case in run.cases:
        for arm in run.arms(case):
            env = run.env(case, arm)
            observation, info = env.reset()
            ...
"""

from __future__ import annotations

import atexit
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv
from numpy.typing import ArrayLike

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.manifests import Manifest, find_case
from pytest_libero_max.benchmark.sampling import stratified
from pytest_libero_max.benchmark.tracks import is_manifest_path, load_cases
from pytest_libero_max.errors import LiberoMaxError, OptionError, ProtocolError, counted, did_you_mean
from pytest_libero_max.evaluation.keeper import RunKeeper
from pytest_libero_max.evaluation.policy_source import PolicySource
from pytest_libero_max.evaluation.resolving import resolve
from pytest_libero_max.evaluation.run_cases import RunCases
from pytest_libero_max.evaluation.settings import OPTIONS, Settings
from pytest_libero_max.evaluation.stopping import Stop
from pytest_libero_max.events.registry import check_cases
from pytest_libero_max.events.schedules import BASE, Arm, arms_of
from pytest_libero_max.pairing.environment import ArmEnv, Info
from pytest_libero_max.pairing.record import ArmRecord, PairError, PairRecord
from pytest_libero_max.pairing.rollout import RolloutResult
from pytest_libero_max.pairing.runner import Pair
from pytest_libero_max.pairing.scene_fingerprints import scene_fingerprints
from pytest_libero_max.pairing.trace import write_trace
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.runs.media import SELECTIONS, TRACES_NAME, is_selected, selection_named
from pytest_libero_max.runs.plan import OUTSIDE
from pytest_libero_max.substrates.contract import ChosenSubstrate, Substrate, SubstrateOptions
from pytest_libero_max.substrates.registry import DEFAULT, open_substrate
from pytest_libero_max.worlds.contract import Observation, World, height_and_width
from pytest_libero_max.worlds.robot import PANDA, ROBOTS


class PairedRun:
    """A run whose pairs are played by somebody else's loop, in one process and one thread.

    A run that was ended early goes on where it was: give the same arguments again.

    Args:
        folder: Output folder of the run.
        policy: The policy as its records name it: cameras and image size of the observations, H (chunk size)
            and Q (execution horizon, replan steps: each answer's first Q actions are executed). With
            ``repeatable`` its answers in Dynamic's executed prefix must be those in Base, or the pair is an
            error.
        cases: A track, the path of a manifest, or a manifest.
        limit: At most so many cases of it, spread evenly; None: all.
        only: Ids of the cases to play, as reports and manifests write them; none: all.
        traces: Pairs whose traces are kept, from which ``libero-max film`` makes films: ``none``,
            ``regressions``, ``changed`` (Base and Dynamic end differently) or ``all``.

    Attributes:
        cases: The cases that are to be played, in the order of play.

    Raises:
        OptionError: The folder holds another run, or one of another policy, or cannot be written to, another
            run is in progress in it, or the track or a case is unknown.
        ManifestError: The manifest cannot be read.
    """

    def __init__(
        self,
        folder: str | Path,
        policy: PolicySpec,
        cases: str | Manifest = "smoke",
        limit: int | None = None,
        substrate: str = DEFAULT,
        options: SubstrateOptions | None = None,
        traces: str = "none",
        only: Sequence[str] = (),
    ) -> None:
        if selection_named(traces) not in SELECTIONS:
            raise OptionError.seen("traces", traces, f", but must be one of {', '.join(SELECTIONS)}.")
        manifest = load_cases(cases) if isinstance(cases, str) else cases
        check_cases(manifest.cases)
        settings = _settings(Path(folder), policy, ChosenSubstrate(substrate, options or SubstrateOptions()))
        of_run = _CasesOfLoop(settings, manifest, _named(cases, manifest), limit, only)
        self._keeper = RunKeeper(
            settings, of_run, _PolicyOfLoop(settings, policy), Stop(settings), Path.cwd(), by_hand=True
        )
        self._keeper.read_before()
        self._keeper.check_folder()
        self._keeper.plan(
            of_run.chosen, self._keeper.selection(of_run.chosen, of_run.asked), sys.argv, Path.cwd()
        )
        self._traces, self._traced = Path(folder) / TRACES_NAME, selection_named(traces)
        self.policy = policy
        self.cases = tuple(
            case
            for case in of_run.chosen
            if case.item_id not in self._keeper.settled and policy.supports(case.suite)
        )
        self._left = {case.case_id for case in self.cases}
        self._begun: dict[str, tuple[str, dict[str, str]]] = {}
        self._ended: dict[str, dict[str, RolloutResult]] = {}
        self._open: Callable[[], Substrate] = lambda: open_substrate(substrate, options)
        self._substrates: dict[int, Substrate] = {}
        self._playing: dict[int, ArmOfRun] = {}
        atexit.register(self.close)

    def arms(self, case: Case) -> tuple[str, ...]:
        """Return the names of the arms of a case, in the order in which they are to be played: Base first."""
        return tuple(arm.name for arm in arms_of(case))

    def env(self, case: Case, arm: str = BASE, place: int = 0) -> ArmOfRun:
        """Return the environment of an arm of a case. Environments of the same place are played in turn.

        Args:
            case: One of :attr:`cases`.
            place: Number of the set of worlds; environments that are played at once have different ones.

        Raises:
            ProtocolError: The case has no such arm.
        """
        arms = {each.name: each for each in arms_of(case)}
        if arm not in arms:
            raise ProtocolError(f"{case.item_id} has no arm {arm!r}. {did_you_mean(arm, arms)}")
        return ArmOfRun(self, case, arms[arm], place)

    def vector(self, cases: Sequence[Case], arm: str = BASE) -> SyncVectorEnv:
        """Return one arm of several cases as a vector environment, each with a world of its own.

        Each is played once: an arm that has ended executes nothing more, also after a reset, and goes on
        showing its end.
        """
        envs = [self.env(case, arm, place) for place, case in enumerate(cases)]
        for env in envs:
            env._once = True
        return SyncVectorEnv([lambda env=env: env for env in envs])

    def close(self) -> None:
        """Close the worlds and end the run; done when the last pair has ended, and at the end of Python."""
        atexit.unregister(self.close)
        for substrate in self._substrates.values():
            substrate.close()
        self._substrates.clear()
        self._playing.clear()
        if self._keeper.store is not None:
            self._keeper.store.close()

    # For the environments.

    def _begin(self, env: ArmOfRun) -> tuple[World, RolloutResult | None]:
        """Return the world of an arm and the Base rollout that it shares its prefix with."""
        base = self._ended.get(env.case.case_id, {}).get(BASE)
        if env.arm.name != BASE and base is None:
            raise ProtocolError(
                f"{env.case.item_id}: arm {env.arm.name!r} shares the executed prefix of Base, which has not "
                "been played to its end by this run. Play Base first."
            )
        if env._once and env.place in self._substrates and self._playing[env.place].case != env.case:
            # A substrate keeps a dozen scenes for cases that share one; ten places would keep ten dozen.
            self._substrates.pop(env.place).close()
        if env.place not in self._substrates:
            self._substrates[env.place] = self._open()
        self._playing[env.place] = env
        return self._substrates[env.place].world(env.case), None if env.arm.name == BASE else base

    def _require_playing(self, env: ArmOfRun) -> None:
        if self._playing.get(env.place) is not env:
            raise ProtocolError(
                f"{env.case.item_id}: another environment has been reset in the same world meanwhile. Play "
                "one episode to its end before the next, or give environments different places."
            )

    def _fingerprints(self, env: ArmOfRun, world: World) -> dict[str, str]:
        return {
            **self._substrates[env.place].fingerprint(images=bool(self.policy.cameras)),
            **scene_fingerprints(world, env.case.init_state_index),
            "adapter": OUTSIDE,
        }

    def _failed(self, case: Case, error: LiberoMaxError, phase: str) -> None:
        if case.case_id in self._left:
            self._keep(PairError.of(case, error, phase))

    def _keep(self, result: PairRecord | PairError) -> None:
        """Store a pair; where it cannot be stored, no later one could be, and the run is over."""
        try:
            self._keeper.add(result)
        except LiberoMaxError:
            self.close()
            raise

    def _end(self, env: ArmOfRun, result: RolloutResult) -> None:
        """Take in an arm that has ended; write the record when it was the last one of its pair."""
        case, arms = env.case, arms_of(env.case)
        if case.case_id not in self._left:
            return
        rollouts = self._ended.setdefault(case.case_id, {})
        rollouts[env.arm.name] = result if result.firings or env.arm.name == BASE else rollouts[BASE]
        if env.differing and self.policy.repeatable:
            self._failed(case, _differs(env, self.policy), env.arm.name)
        elif len(rollouts) == len(arms):
            rollouts = {arm.name: rollouts[arm.name] for arm in arms}
            instruction, fingerprints = self._begun.pop(case.case_id)
            played = {arm.name: ArmRecord.of(arm, rollouts) for arm in arms}
            record = PairRecord.of(case, instruction, played, self.policy, fingerprints, {})
            if is_selected(record, self._traced):
                write_trace(self._traces, Pair(record, rollouts))
            self._keep(self._keeper.checked(record))
        else:
            return
        del self._ended[case.case_id]
        self._left.remove(case.case_id)
        if not self._left:
            self.close()


class ArmOfRun(gymnasium.Env):  # type: ignore[misc]
    """One arm of a case. Its actions are LIBERO's: movement (3), rotation (3) and gripper, -1 to 1.

    The infos are those of :class:`~pytest_libero_max.ArmEnv` without ``probes``, with ``arm`` and
    ``is_success``. An arm that is played after its pair has been written is not written again.

    Attributes:
        place: Number of the set of worlds.
        task_description: The instruction; empty before the first reset.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 - Gymnasium's
    render_mode = "rgb_array"

    def __init__(self, run: PairedRun, case: Case, arm: Arm, place: int) -> None:
        self.case, self.arm, self.place = case, arm, place
        self.task = self.task_description = ""
        self._run, self._max_episode_steps = run, case.budget
        self._env: ArmEnv | None = None
        self._seen: Observation = {}
        self._once = False
        self._last: tuple[Observation, float, bool, bool, Info] | None = None
        shape, robot = (*height_and_width(run.policy.image_size), 3), ROBOTS[run.policy.robot or PANDA.name]
        images = {f"{name}_image": spaces.Box(0, 255, shape, np.uint8) for name in run.policy.cameras}
        state = {name: spaces.Box(-np.inf, np.inf, (size,), np.float64) for name, size in robot.state.items()}
        self.observation_space = spaces.Dict({**state, **images})
        bound = 1.0 if run.policy.control == "delta" else np.inf
        self.action_space = spaces.Box(-bound, bound, (robot.components,), np.float64)

    @property
    def differing(self) -> tuple[int, ...]:
        """Steps of the executed prefix at which the given action was another one than Base's."""
        return () if self._env is None else tuple(self._env.differing)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begin the episode, in the world as the case fixes it; see :meth:`ArmEnv.reset`.

        Raises:
            ProtocolError: Base has not been played to its end before this arm.
            SubstrateError: The substrate cannot build the case.
        """
        run, case = self._run, self.case
        if self._last is not None:
            return self._last[0], self._last[-1]
        world, base = run._begin(self)
        try:
            fingerprints = run._fingerprints(self, world) if base is None else {}
            self._env = ArmEnv(case, world, self.arm, run.policy, base=base)
            self._seen, info = self._env.reset()
        except LiberoMaxError as error:
            run._failed(case, error, self.arm.name)
            raise
        self.task = self.task_description = info["instruction"]
        if base is None:
            run._begun[case.case_id] = (self.task_description, fingerprints)
        return self._seen, self._with(info, False)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, Info]:
        """Execute one action, or that of Base in the executed prefix; see :meth:`ArmEnv.step`.

        Raises:
            ActionError: The action cannot be played.
            ProtocolError: No episode is running, or the executed prefix differs from Base's.
        """
        if self._last is not None:
            return self._last
        self._run._require_playing(self)
        assert self._env is not None
        try:
            self._seen, reward, terminated, truncated, info = self._env.step(action)
        except LiberoMaxError as error:
            self._run._failed(self.case, error, self.arm.name)
            raise
        self.task_description, info = info["instruction"], self._with(info, terminated)
        if terminated or truncated:
            self._run._end(self, self._env.result)
            self._last = (self._seen, 0.0, terminated, truncated, info) if self._once else None
        return self._seen, reward, terminated, truncated, info

    def render(self) -> Any:
        """Return the image of the first camera, upright; None for a policy without cameras."""
        cameras = self._run.policy.cameras
        return self._seen[f"{cameras[0]}_image"][::-1] if cameras and self._seen else None

    def _with(self, info: Info, success: bool) -> Info:
        kept = {name: value for name, value in info.items() if name != "probes"}  # vectors refuse their None
        return {**kept, "arm": self.arm.name, "is_success": success}


class LiberoLoop:
    """An arm behind the methods of LIBERO's ``OffScreenRenderEnv``, for loops written for it.

    The first steps after :meth:`reset` are taken for the loop's own waiting steps and not executed: the world
    has settled already. As in LIBERO, ``done`` is True where the task is completed and not where time is up;
    what is given after that is not executed.
    """

    def __init__(self, env: ArmOfRun, waiting_steps: int = SETTLE_STEPS) -> None:
        self._env, self._waiting_steps, self._waits = env, waiting_steps, 0
        self._over = False
        self._seen: Observation = {}

    @property
    def task_description(self) -> str:
        """The instruction of the policy, after :meth:`reset`."""
        return str(self._env.task_description)

    def seed(self, seed: int) -> None:
        """Do nothing: the case fixes everything."""

    def reset(self) -> Observation:
        """Begin the episode and return the observation."""
        self._waits, self._over = self._waiting_steps, False
        self._seen, _ = self._env.reset()
        return self._seen

    def set_init_state(self, state: object = None) -> Observation:
        """Return the observation of the case's initial state, which :meth:`reset` has set."""
        return self._seen

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, Info]:
        """Execute one action, after those that are not; return observation, reward, done and info."""
        if self._waits or self._over:
            self._waits = max(self._waits - 1, 0)
            return self._seen, 0.0, False, {}
        self._seen, reward, terminated, self._over, info = self._env.step(action)
        return self._seen, reward, terminated, info

    def close(self) -> None:
        """Do nothing: the worlds belong to the run."""


class _CasesOfLoop(RunCases):
    """The cases that arguments choose: a manifest may be none of a file."""

    def __init__(
        self,
        settings: Settings,
        manifest: Manifest,
        names: Mapping[str, str],
        limit: int | None,
        only: Sequence[str],
    ) -> None:
        super().__init__(settings)
        self.manifest = manifest
        self._names, self._limit, self._only = names, limit, only

    @cached_property
    def of_all_shards(self) -> tuple[Case, ...]:
        cases = tuple(dict.fromkeys(find_case(self.manifest, name) for name in self._only))
        cases = cases or self.manifest.cases
        return cases if self._limit is None else stratified(cases, self._limit)

    @property
    def asked(self) -> list[str]:
        limit = [] if self._limit is None else [f"limit={self._limit}"]
        return [*limit, *(f"only={name}" for name in self._only)]

    @property
    def provenance(self) -> Json:
        return {**self._names, "digest": self.manifest.digest, "limit": self._limit}


class _PolicyOfLoop(PolicySource):
    """A policy that only the loop has, known by its spec."""

    def __init__(self, settings: Settings, spec: PolicySpec) -> None:
        super().__init__(settings)
        self._spec = spec

    def check(self) -> None:
        """Look at nothing: there is nothing to load."""

    def identity(self) -> str:
        return OUTSIDE

    def spec(self) -> Json:
        return self._spec.to_dict()


def _settings(folder: Path, policy: PolicySpec, substrate: ChosenSubstrate) -> Settings:
    """Return the settings of a run that a loop plays: it goes on where it was, and its arms are replayed."""
    chosen = {
        "policy": policy.name,
        "track": "",
        "substrate": substrate,
        "libero": substrate.options.installations,
        "libero_assets": substrate.options.assets,
        "prefix": "replay",
        "output": str(folder),
        "resume": True,
    }
    return resolve({**{option.field: option.default for option in OPTIONS}, **chosen}, Path.cwd())


def _named(cases: str | Manifest, manifest: Manifest) -> dict[str, str]:
    """Return the names of the cases in the provenance of a run."""
    released = {} if manifest.recognition is None else {"released_as": str(manifest.recognition)}
    if isinstance(cases, Manifest):
        return {"name": manifest.digest[:12], **released}
    if is_manifest_path(cases):
        return {"name": f"manifest {Path(cases).name}", "path": cases, **released}
    return {"name": f"track {cases}"}


def _differs(env: ArmOfRun, policy: PolicySpec) -> ProtocolError:
    steps = env.differing
    return ProtocolError(
        f"{env.case.item_id}: policy {policy.name!r} answered differently in arm {env.arm.name!r} at "
        f"{counted(len(steps), 'step')} of the executed prefix, at step {steps[0]} first, though it saw "
        "what it saw in Base. Reset its memory and seed its noise when an episode begins, or declare "
        "PolicySpec(repeatable=False)."
    )


__all__ = ["ArmOfRun", "LiberoLoop", "PairedRun"]
