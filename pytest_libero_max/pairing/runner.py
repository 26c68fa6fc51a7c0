"""The runner: plays the arms of a case, shared parts only once, and makes the record.

:func:`play_pair` does all of it. Its parts, for a test of your own: :func:`play_prefix` plays a case up to
its event, :func:`inject` makes the change, :func:`continue_rollout` plays on, :func:`return_to` goes back.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from msgspec import structs

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.events.schedules import (
    BASE,
    DYNAMIC,
    Arm,
    Cadence,
    Entry,
    arms_of,
    change_of,
    check_arms,
    trigger_of,
)
from pytest_libero_max.pairing.changing import apply_change
from pytest_libero_max.pairing.prefix import BranchPoint, PrefixMode, return_to_branch, way_back
from pytest_libero_max.pairing.probes.probe import Probes
from pytest_libero_max.pairing.probes.standard import STANDARD
from pytest_libero_max.pairing.record import ArmRecord, PairRecord, query_times
from pytest_libero_max.pairing.record_rules import QUERY_MS
from pytest_libero_max.pairing.rollout import Parted, Rollout, RolloutResult
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.pairing.wall_clock import NO_WATCH, Clock, Watch
from pytest_libero_max.policies.cadence import played_at
from pytest_libero_max.policies.check import ask_together, batches, memory_of, remembers
from pytest_libero_max.policies.contract import Policy, PolicySpec
from pytest_libero_max.worlds.contract import World


@dataclass(frozen=True)
class PairSettings:
    """Settings of how pairs are played. Nothing here may change what is measured."""

    prefix: PrefixMode = "fork"
    """Way of an arm to the branch point; see :func:`return_to`."""
    fingerprints: Mapping[str, str] = field(default_factory=dict)
    """Versions, substrate, scene: whatever could change a result, for the record."""
    watch: Watch = NO_WATCH
    """Notified of each call, so that it can end one that takes too long."""
    probes: Probes = STANDARD
    """The probes that read every arm; see
    :func:`~pytest_libero_max.pairing.probes.registry.probes_called`."""
    films: bool = False
    """True if rollouts keep what films are drawn from."""
    policies: Mapping[str, Policy] = field(default_factory=dict)
    """The checked policies that arms name."""


@dataclass(frozen=True)
class Pair:
    """A measured case with its trajectories."""

    record: PairRecord
    rollouts: Mapping[str, RolloutResult]
    """By name of the arm. Arms that ended as one have the same object."""

    @property
    def base(self) -> RolloutResult:
        """The Base rollout."""
        return self.rollouts[BASE]

    @property
    def dynamic(self) -> RolloutResult | None:
        """The Dynamic rollout; None where the event never fired."""
        return None if self.record.arms[DYNAMIC].shares else self.rollouts[DYNAMIC]


def play_pair(
    case: Case,
    world: World,
    policy: Policy,
    settings: PairSettings | None = None,
    on_phase: Callable[[str], None] | None = None,
    arms: Sequence[Arm] | None = None,
) -> PairRecord:
    """Measure a case; see :func:`measure_pair`, which returns the trajectories as well."""
    return measure_pair(case, world, policy, settings, on_phase, arms).record


def measure_pair(
    case: Case,
    world: World,
    policy: Policy,
    settings: PairSettings | None = None,
    on_phase: Callable[[str], None] | None = None,
    arms: Sequence[Arm] | None = None,
) -> Pair:
    """Play the arms of a case: Base and Dynamic, unless others are given.

    An arm in which nothing happens before the end executes the same actions in the same world as the arm it
    still shares everything with: its result is that of the other, and it is not played again.

    Args:
        case: The case.
        world: A world of the case's scene, in any state.
        policy: A checked policy.
        settings: The settings.
        on_phase: Called with ``setup`` and then with the name of each arm as it begins, to locate errors.
        arms: The arms. None: those of :func:`~pytest_libero_max.events.schedules.arms_of`.

    Raises:
        AdapterError: The policy broke its contract.
        ProtocolError: Two arms do not share their prefix, or a change altered nothing.
        SimulatorError: The simulation broke.
        SubstrateError: The world cannot start this case.
        ChangeError: The setup or a change does not fit this world.
        ManifestError: Two arms have one name.
        ProbeError: A probe raised, or wrote to the world.
    """
    return _driven(_pair(case, world, policy, settings, on_phase, arms))


def measure_in_step(
    places: Sequence[tuple[Case, World]], policy: Policy, settings: PairSettings | None = None
) -> list[Pair]:
    """Play several pairs at once, whose queries one policy answers together.

    In each round every pair plays on to its next query, and ``predict_batch`` answers all of them. Each pair
    is the one that :func:`measure_pair` plays, where a batch's answers are those of single queries.

    Args:
        places: The cases, of which Base and Dynamic are played, each with a world of its own.
        policy: A checked policy with ``predict_batch``, without a memory, that reads no simulator.
        settings: The settings.

    Returns:
        The pairs in the order of the places.

    Raises:
        AdapterError: The policy cannot answer queries of several episodes together, or two places have one
            world.
        LiberoMaxError: One of the pairs could not be played, see :func:`measure_pair`; none is returned then.
    """
    name = policy.spec.name
    if not batches(policy) or memory_of(policy) != "none" or policy.spec.privileged:
        raise AdapterError(
            f"policy {name!r} cannot answer queries of several episodes together: that takes "
            "predict_batch(items), no memory, and no look into the simulator. Play its pairs one by one."
        )
    if len({id(world) for _, world in places}) < len(places):
        raise AdapterError("two pairs that are played in step have one world. Give each a world of its own.")
    playing = {number: _pair(*place, policy, settings) for number, place in enumerate(places)}
    pairs: dict[int, Pair] = {}
    try:
        while playing:
            due: list[Rollout] = []
            for number, pair in tuple(playing.items()):
                try:
                    due.append(next(pair))
                except StopIteration as end:
                    pairs[number] = end.value
                    del playing[number]
            if due:
                answers = ask_together(policy, [rollout.item() for rollout in due])
                for rollout, actions in zip(due, answers, strict=True):
                    rollout.answer(actions)
    finally:
        for pair in playing.values():
            pair.close()  # takes back what was written to its world
    return [pairs[number] for number in range(len(places))]


_Playing = Generator[Rollout, None, Pair]
"""A pair being played: yields the rollout whose query is due, and goes on once that is answered."""


def _driven(playing: _Playing) -> Pair:
    """Return a pair whose queries the policy of its stage answers, one by one."""
    try:
        rollout = next(playing)
        while True:
            try:
                rollout.ask()
            except BaseException as error:
                rollout = playing.throw(error)  # so that writes to the world are found and taken back
            else:
                rollout = next(playing)
    except StopIteration as end:
        pair: Pair = end.value
        return pair


def _pair(
    case: Case,
    world: World,
    policy: Policy,
    settings: PairSettings | None,
    on_phase: Callable[[str], None] | None = None,
    arms: Sequence[Arm] | None = None,
) -> _Playing:
    """Play a pair; see :func:`measure_pair`."""
    settings = PairSettings() if settings is None else settings
    enter = on_phase or (lambda phase: None)
    enter("setup")
    clock, spec = Clock(), replace(policy.spec)
    chosen = check_arms(arms_of(case) if arms is None else arms)
    _require_policies(chosen, settings.policies)
    rollouts: dict[str, RolloutResult] = {}
    for cadence, latency in dict.fromkeys(map(_begins_with, chosen)):
        together = tuple(arm for arm in chosen if _begins_with(arm) == (cadence, latency))
        with played_at(policy, cadence):
            stage = Stage(case, world, policy, clock, settings.watch, settings.probes, settings.films)
            try:
                instruction, results = yield from _play(stage, together, settings, enter)
            except Exception:
                stage.require_untouched()  # a write to the model may be what the error came from
                raise
            except BaseException:
                world.take_back_writes()
                raise
        rollouts |= results
    rollouts = {arm.name: rollouts[arm.name] for arm in chosen}
    played = {arm.name: ArmRecord.of(arm, rollouts) for arm in chosen}
    for arm in chosen:
        # Where nothing happened, nobody went on: the arm is another one, with the policy of that.
        if arm.policy is not None and played[arm.name].shares is None:
            with played_at(settings.policies[arm.policy], arm.cadence) as acting:
                named = {"reference": arm.policy, **acting.to_dict()}
                named |= {"at_once": True} if arm.at_once else {}
            played[arm.name] = structs.replace(played[arm.name], policy=named)
    times = query_times(rollouts)
    timings = {**clock.seconds, **({QUERY_MS: times} if times else {})}
    record = PairRecord.of(case, instruction, played, spec, settings.fingerprints, timings, memory_of(policy))
    return Pair(record, rollouts)


def _require_policies(arms: Sequence[Arm], policies: Mapping[str, Policy]) -> None:
    for arm in arms:
        if arm.policy is not None and arm.policy not in policies:
            raise AdapterError.seen(
                f"policy of arm {arm.name!r}",
                arm.policy,
                f", but it is not among the policies of the settings. {did_you_mean(arm.policy, policies)} "
                "Add it to PairSettings(policies=...).",
            )


def _begins_with(arm: Arm) -> tuple[Cadence | None, Latency]:
    """Return cadence and latency of an arm's first step, where the policy of Base plays in every arm."""
    return arm.cadence if arm.policy is None else None, arm.latency


def _play(
    stage: Stage, arms: tuple[Arm, ...], settings: PairSettings, enter: Callable[[str], None]
) -> Generator[Rollout, None, tuple[str, dict[str, RolloutResult]]]:
    """Play all arms, each shared part once.

    Returns:
        The instruction when an episode begins, and the results in the order of the arms.
    """
    repetitions = dict.fromkeys(arm.repetition for arm in arms)
    tasks = [Parted(tuple(arm for arm in arms if arm.repetition == number)) for number in repetitions]
    results: dict[str, RolloutResult] = {}
    instruction = ""
    while tasks:
        task = tasks.pop(0)
        arm, branch = task.arms[0], task.branch
        goes_on = branch is not None and arm.policy is not None
        policy = settings.policies[arm.policy or ""] if goes_on else stage.policy
        with played_at(policy, arm.cadence if goes_on else None):
            acting = stage
            if branch is None:
                rollout = Rollout.start(stage, task.arms)
                instruction = stage.instruction
                enter(arm.name)
            else:
                enter(arm.name)
                with stage.clock("prefix_s"):
                    return_to_branch(branch, stage, settings.prefix)
                if goes_on:
                    acting = stage.handed_to(policy, branch.handover_of(stage.spec.name))
                    branch = branch.handed_to(policy.spec.query_interval, arm.at_once)
                rollout = Rollout.resume(branch, acting, task.arms)
            with stage.clock(f"arm_{arm.name}_s"):
                while rollout.due() is not None:
                    yield rollout
            results |= dict.fromkeys((arm.name for arm in rollout.arms), rollout.result())
            acting.require_untouched()
            if len(task.arms) > 1 or branch is not None:  # also where no event ever fired
                _check_policy(rollout, acting, settings.prefix)
        tasks = rollout.parted + tasks
    return instruction, {arm.name: results[arm.name] for arm in arms}


def _check_policy(rollout: Rollout, stage: Stage, mode: PrefixMode) -> None:
    """Ask a late query of an arm again: a memory that is not carried may matter only after many queries.

    In ``replay`` a policy without ``snapshot`` may remember what it has seen, all of which it is shown.
    """
    mode = way_back(stage.policy, mode)
    if rollout.recorded is not None and (mode == "fork" or remembers(stage.policy)):
        rollout.recorded.ask_again(stage)


# The pieces.


def play_prefix(
    case: Case, world: World, policy: Policy, latency: Latency = NO_LATENCY
) -> BranchPoint | None:
    """Play a case up to its event, which is not applied; None where the episode ends without it.

    World and policy are left at the branch point. The other arguments and the errors are those of
    :func:`measure_pair`.

    Args:
        case: The case.
        world: A world of its scene.
        policy: A checked policy.
        latency: Time that a query takes, also where :func:`continue_rollout` goes on from there.
    """
    arms = (Arm(BASE, latency=latency), Arm(DYNAMIC, (Entry(trigger_of(case), Nothing()),), latency=latency))
    rollout = Rollout.start(Stage(case, world, policy), arms)
    while rollout.running:
        rollout.let_happen()
        if rollout.parted:
            return rollout.parted[0].branch
        rollout.advance()
    return None


def inject(case: Case, world: World, spec: PolicySpec | None = None, strength: float = 1.0) -> Json:
    """Apply the case's event to the world now, once, and return its evidence.

    Args:
        case: The case.
        world: Its world, at the branch point.
        spec: Policy spec with the cameras in which to measure the change of pixels; None to render nothing.
        strength: Share of the event's change, see :func:`~pytest_libero_max.events.schedules.change_of`.

    Returns:
        The change's evidence (see :class:`pytest_libero_max.changes.change.Evidence`) with ``pixel_change``,
        the mean absolute difference of each of those cameras' images, 0 to 255.

    Raises:
        ProtocolError: The event left the world bit for bit as it was.
        ChangeError: It does not fit this world, or cannot be scaled to this strength.
    """
    return apply_change(change_of(case, strength), world, spec, case.item_id).to_dict()


def return_to(
    branch: BranchPoint, case: Case, world: World, policy: Policy, mode: PrefixMode = "fork"
) -> None:
    """Bring world and policy back to a branch point; see :func:`.prefix.return_to_branch`."""
    return_to_branch(branch, Stage(case, world, policy), mode)


def continue_rollout(branch: BranchPoint, case: Case, world: World, policy: Policy) -> RolloutResult:
    """Play on from a branch point to the end of the episode: queued actions first, then queries.

    World and policy are where :func:`play_prefix` or :func:`return_to` left them, or altered since by
    :func:`inject` or any other change. The errors are those of :func:`measure_pair`.
    """
    stage = Stage(case, world, policy)
    same = world.snapshot().assigned[0] == branch.state.assigned[0]
    stage.begun_with(world.language if same else None)
    return Rollout.resume(branch, stage).advance_to_end()
