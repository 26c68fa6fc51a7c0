"""Plays the arms of a recorded pair again, side by side, and shows each step.

No policy is queried: the recorded actions are executed, and the entries of an arm happen again at
the recorded step. The hash chain is computed again on the way. It is compared with the record before each
event and at the end of each arm, so that the film shows the pair as it was played, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ProtocolError, ReportError
from pytest_libero_max.events.schedules import Revert, schedule_from_list
from pytest_libero_max.pairing.changing import Applied, apply_change, begin_world
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.pairing.trace import ArmTrace
from pytest_libero_max.pairing.trajectory import event_link, first_link, next_link
from pytest_libero_max.worlds.contract import CAMERAS, Image, Observation, World, WorldState


@dataclass(frozen=True, eq=False)
class View:
    """View of a world at one moment.

    Attributes:
        images: By camera, (size, size, 3) uint8, upright; or by another name an image of the policy's.
        opening_m: Distance between the fingers, m.
        words: Text for the picture beside that of the record.
    """

    images: Mapping[str, Image]
    opening_m: float
    words: tuple[str, ...] = ()


Look = Callable[[str, int, World, View | None], View]
"""View of a world for an arm after a number of policy steps, given the arm's last view."""


@dataclass(frozen=True, eq=False)
class Tick:
    """All arms after the same number of policy steps.

    Attributes:
        step: Policy steps executed.
        views: By arm. An arm that ended earlier shows its last step.
    """

    step: int
    views: Mapping[str, View]


def distinct_arms(record: PairRecord) -> tuple[str, ...]:
    """Return the arms of a pair that differ from those before them, in the order of the record."""
    proofs: dict[str | None, str] = {}
    for name, arm in record.arms.items():
        if arm.shares is None:
            proofs.setdefault(arm.proof, name)
    return tuple(proofs.values())


def play_again(
    case: Case,
    world: World,
    record: PairRecord,
    traces: Mapping[str, ArmTrace],
    look: Look,
    every: int = 1,
    also: Collection[int] = (),
) -> Iterator[Tick]:
    """Play the distinct arms of a recorded pair again and yield the view after each step.

    Worlds that are the same bit for bit are drawn once. The world is left anywhere; a reset makes it new.

    Args:
        case: The case of the record.
        world: Its world.
        record: The record of the pair.
        traces: The actions of its arms.
        look: Looks at the world; see :func:`through_cameras`.
        every: Show only every so many steps, and the last one.
        also: Policy steps after which views are made even where they are not shown.

    Raises:
        ProtocolError: The replay does not reach a recorded digest. Earlier views may be wrong.
        ReportError: The record or the traces lack something, or are of another case.
        ChangeError: A change does not fit this world.
        SimulatorError: The simulation broke, or the renderer does not answer.
    """
    if record.case_digest != case.digest:
        raise ReportError(
            f"{record.item_id} was played as another case (digest {record.case_digest[:12]}, now "
            f"{case.digest[:12]}). Give the track or manifest of the run."
        )
    names = distinct_arms(record)
    begin_world(case, world, record.policy.get("control", "delta"))
    link = first_link(world.digest())
    players = [
        _Player(name, record.arms[name], traces[name], case.item_id, link, world.snapshot()) for name in names
    ]
    last = max(player.steps for player in players)
    views: dict[str, View] = {}
    for step in range(last + 1):
        played = [player for player in players if step <= player.steps]
        _advance(played, step, world)
        shown = step % every == 0 or step == last
        if shown or step in also or any(step == player.steps for player in played):
            views |= _look(played, step, world, look, views)
        if shown:
            yield Tick(step, dict(views))


class _Player:
    """One arm while it is played again: its state, and the recorded values that it must reach."""

    def __init__(
        self, name: str, record: ArmRecord, trace: ArmTrace, item_id: str, link: bytes, state: WorldState
    ) -> None:
        if record.schedule is None or record.proof is None or record.steps is None:
            raise ReportError(
                f"{item_id}: the record of arm {name!r} is of an early version and does not say what "
                "happened when. Play the pair again."
            )
        self.name, self.item_id = name, item_id
        self.steps, self.proof = record.steps, record.proof
        self.actions = trace.actions
        self.schedule = schedule_from_list(list(record.schedule), f"schedule of arm {name!r}")
        self.firings = record.firings
        self.applied: list[Applied] = []
        self.link, self.state = link, state

    def fires_at(self, step: int) -> bool:
        """Return True if something happens after this step that has not happened yet."""
        done = len(self.applied)
        return done < len(self.firings) and self.firings[done].step == step

    def fire(self, step: int, world: World) -> None:
        """Repeat the entry that happened after this step; the world is this arm's."""
        while self.fires_at(step):
            index = len(self.applied)
            self.require(self.firings[index].prefix_proof, f"before its event after step {step}")
            action = self.schedule[index].action
            if isinstance(action, Revert):
                earlier = self.applied[action.entry]
                action = earlier.change.reverted(earlier.evidence)
            before = world.digest()
            self.applied.append(apply_change(action, world, None, self.item_id))
            digest = world.digest()
            if digest != before:
                self.link = event_link(self.link, digest)
            self.state = world.snapshot()

    def require(self, proof: str, where: str) -> None:
        if self.link.hex() != proof:
            raise ProtocolError(
                f"{self.item_id}: the replay of arm {self.name!r} is not what was recorded, {where}. The "
                "simulation computes something else here than where the pair was played."
            )


def _advance(players: list[_Player], step: int, world: World) -> None:
    """Play the arms to this step. Those that are the same bit for bit are played once."""
    reached: dict[tuple[bytes, bytes], tuple[bytes, WorldState]] = {}
    for player in players:
        if step:
            action = player.actions[step - 1]
            key = player.link, action.tobytes()
            if key not in reached:
                world.restore(player.state)
                world.step(action)
                reached[key] = next_link(player.link, action, world.digest()), world.snapshot()
            player.link, player.state = reached[key]
        if player.fires_at(step):
            world.restore(player.state)
            player.fire(step, world)
        if step == player.steps:
            player.require(player.proof, "at its end")


def through_cameras(size: int, cameras: tuple[str, ...] = CAMERAS) -> Look:
    """Return the view of a world through its cameras.

    Args:
        size: Side of an image in pixels.
        cameras: The cameras.
    """

    def look(name: str, step: int, world: World, before: View | None) -> View:
        observation = world.observe(cameras, size)
        images = {camera: observation[f"{camera}_image"][::-1] for camera in cameras}
        return View(images, opening_m(observation))

    return look


def opening_m(observation: Observation) -> float:
    """Distance between the fingers, m."""
    fingers = observation["robot0_gripper_qpos"]
    return float(fingers[0] - fingers[1])


def _look(
    players: list[_Player], step: int, world: World, look: Look, before: Mapping[str, View]
) -> dict[str, View]:
    seen: dict[bytes, View] = {}
    for player in players:
        if player.link not in seen:
            world.restore(player.state)
            seen[player.link] = look(player.name, step, world, before.get(player.name))
    return {player.name: seen[player.link] for player in players}
