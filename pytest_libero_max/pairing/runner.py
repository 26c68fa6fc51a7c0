"""The runner: plays the arms of a case, what they share only once, and makes the record.

:func:`play_pair` does all of it. Its pieces, for a test of your own: :func:`play_prefix` plays a case up to
its event, :func:`inject` makes the change, :func:`continue_rollout` plays on, :func:`return_to` goes back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.events.schedules import (
    BASE,
    DYNAMIC,
    Arm,
    Entry,
    arms_of,
    change_of,
    check_arms,
    trigger_of,
)
from pytest_libero_max.pairing.cadence import played_at
from pytest_libero_max.pairing.clock import Clock
from pytest_libero_max.pairing.prefix import BranchPoint, PrefixMode, return_to_branch, way_back
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.pairing.rollout import Rollout, RolloutResult
from pytest_libero_max.pairing.stage import Stage, apply_change
from pytest_libero_max.pairing.watch import NO_WATCH, Watch
from pytest_libero_max.policies.check import memory_of, remembers
from pytest_libero_max.policies.contract import Policy, PolicySpec
from pytest_libero_max.worlds.contract import World


@dataclass(frozen=True)
class PairSettings:
    """How pairs are played. Nothing here may change what is measured.

    Attributes:
        prefix: How an arm gets to the branch point; see :func:`return_to`.
        fingerprints: What could change a result, for the record: versions, substrate, assets.
        watch: Told what begins, so that it can end what takes too long.
    """

    prefix: PrefixMode = "fork"
    fingerprints: Mapping[str, str] = field(default_factory=dict)
    watch: Watch = NO_WATCH


@dataclass(frozen=True)
class Pair:
    """A measured case with its trajectories.

    Attributes:
        record: What is kept of it.
        rollouts: By name of the arm. Arms that ended as one have the same object.
    """

    record: PairRecord
    rollouts: Mapping[str, RolloutResult]

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
        case: What to play.
        world: A world of the case's scene; what it was doing before leaves no trace.
        policy: A checked policy.
        settings: How to play.
        on_phase: Told when ``setup`` begins, and then each arm by its name, so that an error can be placed.
        arms: Which arms. None: those of :func:`~pytest_libero_max.events.schedules.arms_of`.

    Raises:
        AdapterError: The policy broke its contract.
        ProtocolError: Two arms do not share their prefix, or a change altered nothing.
        SimulatorError: The simulation broke.
        SubstrateError: The world cannot start this case.
        ChangeError: The setup or a change does not fit this world.
        ManifestError: Two arms have one name.
    """
    settings = PairSettings() if settings is None else settings
    enter = on_phase or (lambda phase: None)
    enter("setup")
    clock, spec = Clock(), replace(policy.spec)
    chosen = check_arms(arms_of(case) if arms is None else arms)
    rollouts: dict[str, RolloutResult] = {}
    for cadence in dict.fromkeys(arm.cadence for arm in chosen):
        together = tuple(arm for arm in chosen if arm.cadence == cadence)
        with played_at(policy, cadence):
            stage = Stage(case, world, policy, clock, settings.watch)
            try:
                instruction, results = _play(stage, together, settings.prefix, enter)
            except Exception:
                stage.require_untouched()  # a write to the model may be what the error came from
                raise
            except BaseException:
                world.take_back_writes()
                raise
        rollouts |= results
    rollouts = {arm.name: rollouts[arm.name] for arm in chosen}
    played = {arm.name: ArmRecord.of(arm, rollouts) for arm in chosen}
    record = PairRecord.of(
        case, instruction, played, spec, settings.fingerprints, clock.seconds, memory_of(policy)
    )
    return Pair(record, rollouts)


@dataclass(frozen=True)
class _Task:
    """Arms that have shared everything so far, and where they go on from; None: from the start."""

    arms: tuple[Arm, ...]
    branch: BranchPoint | None = None


def _play(
    stage: Stage, arms: tuple[Arm, ...], mode: PrefixMode, enter: Callable[[str], None]
) -> tuple[str, dict[str, RolloutResult]]:
    """Play all arms, each shared part once.

    Returns:
        What the policy is told to do when an episode begins, and the results in the order of the arms.
    """
    repetitions = dict.fromkeys(arm.repetition for arm in arms)
    tasks = [_Task(tuple(arm for arm in arms if arm.repetition == number)) for number in repetitions]
    results: dict[str, RolloutResult] = {}
    instruction = ""
    while tasks:
        task = tasks.pop(0)
        name = task.arms[0].name
        if task.branch is None:
            rollout = Rollout.start(stage)
            instruction = stage.instruction
            enter(name)
        else:
            enter(name)
            with stage.clock("prefix_s"):
                return_to_branch(task.branch, stage, mode)
            rollout = Rollout.resume(task.branch, stage)
        with stage.clock(f"arm_{name}_s"):
            together, parted = _play_together(rollout, task.arms)
        stage.require_untouched()
        results |= dict.fromkeys((arm.name for arm in together), rollout.result())
        if parted or task.branch is not None:
            _check_policy(rollout, stage, mode)
        tasks = parted + tasks
    return instruction, {arm.name: results[arm.name] for arm in arms}


def _check_policy(rollout: Rollout, stage: Stage, mode: PrefixMode) -> None:
    """Ask a late query of an arm again: a memory that is not carried may matter only after many queries.

    In ``replay`` a policy without ``snapshot`` may remember what it has seen, all of which it is shown.

    Raises:
        ProtocolError: See :meth:`.consistency.Asked.ask_again`.
        AdapterError: Likewise.
    """
    mode = way_back(stage.policy, mode)
    if rollout.asked is not None and (mode == "fork" or remembers(stage.policy)):
        rollout.asked.ask_again(stage)


def _play_together(rollout: Rollout, arms: tuple[Arm, ...]) -> tuple[tuple[Arm, ...], list[_Task]]:
    """Play to the end with the arms that stay equal; return these, and those that parted as tasks."""
    parted: list[_Task] = []
    while True:
        done = len(rollout.firings)
        groups = _by_next_entry(arms, done)
        rollout.may_branch = any(arm.schedule[done:] != arms[0].schedule[done:] for arm in arms)
        happening = _wait(rollout, [entry for entry, _ in groups if entry is not None])
        if not happening:
            return arms, parted
        if len(groups) == 1:
            rollout.fire(happening[0])
            continue
        # Arms in which nothing happens now go on first; where something happens in all, those of one entry.
        quiet = tuple(arm for entry, group in groups if entry not in happening for arm in group)
        leaving = groups if quiet else groups[1:]
        branch = rollout.branch()
        parted += [_Task(group, branch) for entry, group in leaving if entry in happening]
        arms = quiet or groups[0][1]


def _by_next_entry(arms: Sequence[Arm], done: int) -> list[tuple[Entry | None, tuple[Arm, ...]]]:
    """The arms by what happens next in them; None where nothing does."""
    groups: list[tuple[Entry | None, tuple[Arm, ...]]] = []
    for arm in arms:
        entry = arm.schedule[done] if done < len(arm.schedule) else None
        place = next((i for i, (known, _) in enumerate(groups) if known == entry), None)
        if place is None:
            groups.append((entry, (arm,)))
        else:
            groups[place] = (entry, (*groups[place][1], arm))
    return groups


def _wait(rollout: Rollout, entries: list[Entry]) -> list[Entry]:
    """Play until the first of the entries happen, and return these; none at the end of the episode."""
    while rollout.running:
        moment = rollout.moment
        happening = [entry for entry in entries if entry.trigger.fires(moment)]
        if happening:
            return happening
        rollout.advance()
    return []


# The pieces.


def play_prefix(case: Case, world: World, policy: Policy) -> BranchPoint | None:
    """Play a case up to its event, which is not applied; None where the episode ends without it.

    World and policy are left at the branch point. The arguments and errors are those of :func:`measure_pair`.
    """
    rollout = Rollout.start(Stage(case, world, policy))
    event = Entry(trigger_of(case), Nothing())
    return rollout.branch() if _wait(rollout, [event]) else None


def inject(case: Case, world: World, spec: PolicySpec | None = None, strength: float = 1.0) -> Json:
    """Apply the case's event to the world now, once, and say what it did.

    Args:
        case: The case.
        world: Its world, at the branch point.
        spec: Whose cameras to measure the change of pixels in. None: nothing is rendered.
        strength: Share of the event's change, see :func:`~pytest_libero_max.events.schedules.change_of`.

    Returns:
        The change's evidence (see :class:`pytest_libero_max.changes.base.Evidence`) with ``pixel_change``,
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
    return Rollout.resume(branch, Stage(case, world, policy)).advance_to_end()
