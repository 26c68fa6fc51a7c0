"""Shows the arms of a recorded pair side by side.

No policy is queried. For films of the world a run keeps the positions of all joints: the changes of an arm
are made again at the recorded steps, and nothing is simulated. Otherwise the recorded actions are executed,
and the hash chain is computed again on the way. It is compared with the record before each event and at the
end of each arm, so that what is shown is the pair as it was played, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ProtocolError, ReportError
from pytest_libero_max.events.schedules import Revert, schedule_from_list
from pytest_libero_max.pairing.changing import Applied, apply_change, begin_world
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.pairing.trace import ArmTrace
from pytest_libero_max.pairing.trajectory import event_link, first_link, next_link
from pytest_libero_max.runs.media import distinct_arms
from pytest_libero_max.worlds.contract import Image, Observation, PosedWorld, World, WorldState
from pytest_libero_max.worlds.rendering.appearance import (
    Appearance,
    Points,
    appearance,
    left,
    outlines,
    places_of,
)


@dataclass(frozen=True, eq=False)
class View:
    """View of a world at one moment."""

    images: Mapping[str, Image]
    """By camera, (size, size, 3) uint8, upright; or by another name an image of the policy's."""
    opening_m: float
    """Distance between the fingers, m."""
    words: tuple[str, ...] = ()
    """Text for the picture beside that of the record."""
    outlines: Mapping[str, Sequence[NDArray[np.int32]]] = field(default_factory=dict)
    """By camera, (n, 2) pixels of each thing that an event has moved away, where it was."""


Look = Callable[[str, int, World, View | None], View]
"""View of a world for an arm after a number of policy steps, given the arm's last view."""


@dataclass(frozen=True, eq=False)
class Tick:
    """All arms after the same number of policy steps."""

    step: int
    views: Mapping[str, View]
    """By arm. An arm that ended earlier shows its last step."""


def play_again(
    case: Case,
    world: World,
    record: PairRecord,
    traces: Mapping[str, ArmTrace],
    look: Look,
    every: int = 1,
    also: Collection[int] = (),
    *,
    simulate: bool = True,
) -> Iterator[Tick]:
    """Play the distinct arms of a recorded pair again and yield the view after each step.

    Worlds that are the same bit for bit are drawn once. The world is left anywhere; a reset makes it new.

    Args:
        every: Show only every so many steps, those of events, and the last one.
        also: Policy steps after which views are made even where they are not shown.
        simulate: False to show the positions that the traces have, where they have them.

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
    if not simulate and all(traces[name].joints is not None for name in names):
        for player in players:
            player.joints = traces[player.name].joints
    ends = {player.steps for player in players}
    changed = {firing.step for player in players for firing in player.firings}
    shown = {*range(0, max(ends), every), *changed, max(ends)}
    views: dict[str, View] = {}
    for step in sorted(shown | ends | {step for step in also if step < max(ends)}):
        playing = [player for player in players if step <= player.steps]
        _advance(playing, step, world)
        views |= _look(playing, step, world, look, views)
        if step in shown:
            yield Tick(step, dict(views))


class _Player:
    """One arm while it is played again: its state, and the recorded values that it must reach."""

    def __init__(
        self, name: str, record: ArmRecord, trace: ArmTrace, item_id: str, link: bytes, state: WorldState
    ) -> None:
        self.name, self.item_id = name, item_id
        self.steps, self.proof = record.steps, record.proof
        self.actions = trace.actions
        self.schedule = schedule_from_list(list(record.schedule), f"schedule of arm {name!r}")
        self.firings = record.firings
        self.applied: list[Applied] = []
        self.places: list[Points] = []
        self.step, self.link, self.state = -1, link, state
        self.joints: NDArray[np.float32] | None = None
        self._steps_before = state.steps

    def play(self, end: int, world: World) -> None:
        """Play on to this step, on a world in any state."""
        if self.joints is not None:
            self._show(self.joints, end, world)
            return
        world.restore(self.state)
        for step in range(self.step + 1, end + 1):
            if step:
                action = self.actions[step - 1]
                world.step(action)
                self.link = next_link(self.link, action, world.digest())
            if self.fires(step, step):
                self._fire(step, world)
            if step == self.steps:
                self.require(self.proof, "at its end")
        self.step, self.state = end, world.snapshot()

    def _show(self, joints: NDArray[np.float32], end: int, world: World) -> None:
        """Go on to the recorded positions after this step, with the changes that happened until then."""
        changed = -1
        for firing in self.firings[len(self.applied) :]:
            if firing.step <= end and changed != firing.step:
                self._place(joints, firing.step, world)
                world.restore(self.state)
                self._fire(firing.step, world)
                self.state, changed = world.snapshot(), firing.step
        if changed != end:
            self._place(joints, end, world)
        self.step = end
        own = f"{self.name}, {len(self.applied)}" if self.applied else ""
        self.link = self.state.physics.tobytes() + own.encode()

    def _place(self, joints: NDArray[np.float32], step: int, world: World) -> None:
        if step:
            posed = cast(PosedWorld, world).posed  # only the traces of such a world have positions
            self.state = posed(self.state, joints[step - 1], self._steps_before + step)

    def fires(self, first: int, last: int) -> bool:
        """Return True if something happens in this range of steps that has not happened yet."""
        return any(first <= firing.step <= last for firing in self.firings[len(self.applied) :])

    def goes_with(self, other: _Player, end: int) -> bool:
        """Return True if another arm, which is where this one is, does the same up to this step."""
        begin = max(self.step, 0)
        return (
            (self.step, self.link) == (other.step, other.link)
            and not self.fires(self.step + 1, end)
            and not other.fires(self.step + 1, end)
            and self.actions[begin:end].tobytes() == other.actions[begin:end].tobytes()
        )

    def follow(self, other: _Player) -> None:
        """Take the place of another arm, with which this one goes."""
        self.step, self.link, self.state = other.step, other.link, other.state
        if self.step == self.steps:
            self.require(self.proof, "at its end")

    def _fire(self, step: int, world: World) -> None:
        """Repeat the entries that happened after this step; the world is this arm's."""
        while self.fires(step, step):
            index = len(self.applied)
            self.require(self.firings[index].prefix_proof, f"before its event after step {step}")
            action = self.schedule[index].action
            if isinstance(action, Revert):
                earlier = self.applied[action.entry]
                action = earlier.change.reverted(earlier.evidence)
            before, places = world.digest(), places_of(world)
            self.applied.append(apply_change(action, world, None, self.item_id))
            digest = world.digest()
            if digest != before:
                self.link = event_link(self.link, digest)
            self.places += left(places, world)

    def require(self, proof: str, where: str) -> None:
        if self.joints is None and self.link.hex() != proof:
            raise ProtocolError(
                f"{self.item_id}: the replay of arm {self.name!r} is not what was recorded, {where}. The "
                "simulation computes something else here than where the pair was played."
            )


def _advance(players: list[_Player], step: int, world: World) -> None:
    """Play the arms to this step. What is the same bit for bit is played once."""
    played: list[tuple[_Player, _Player]] = []
    for player in players:
        begun = copy(player)
        begun.applied = list(player.applied)  # what fires from here on is not of the beginning
        known = next((after for before, after in played if player.goes_with(before, step)), None)
        if known is None:
            player.play(step, world)
            played.append((begun, player))
        else:
            player.follow(known)


def through_cameras(size: int) -> Look:
    """Return the view of a world through its cameras. A world that looks as it did is not drawn again."""
    drawn: dict[str, Appearance] = {}

    def look(name: str, step: int, world: World, before: View | None) -> View:
        now, last = appearance(world), drawn.get(name)
        if before is not None and now is not None and last is not None and now.is_like(last):
            return replace(before, opening_m=opening_m(world, world.observe((), 1)))
        if now is not None:
            drawn[name] = now
        cameras = world.robot.cameras
        observation = world.observe(cameras, size)
        images = {camera: observation[f"{camera}_image"][::-1] for camera in cameras}
        return View(images, opening_m(world, observation))

    return look


def opening_m(world: World, observation: Observation) -> float:
    """Distance between the fingers, m: the sum of their ways from closed, of whichever sign."""
    return float(np.abs(observation[world.robot.fingers_key]).sum())


def _look(
    players: list[_Player], step: int, world: World, look: Look, before: Mapping[str, View]
) -> dict[str, View]:
    seen: dict[bytes, View] = {}
    for player in players:
        if player.link not in seen:
            world.restore(player.state)
            view = look(player.name, step, world, before.get(player.name))
            seen[player.link] = replace(view, outlines=outlines(player.places, world, view.images))
    return {player.name: seen[player.link] for player in players}
