"""Measurements that several rules share: each is taken once, because a reset of LIBERO takes a second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.environment.observing import Reading, hand_of
from pytest_libero_max.conformance.environment.recording import turn_between
from pytest_libero_max.conformance.environment.subject import EnvironmentSubject

Array = NDArray[np.float64]


def copied(reading: Reading) -> Reading:
    """Return a reading that later steps cannot alter."""
    return {role: value if isinstance(value, str) else np.array(value) for role, value in reading.items()}


def settled(subject: EnvironmentSubject) -> Reading:
    """Return the first observation that a policy is shown."""
    return copied(subject.begin(drawn=True))


@dataclass(frozen=True)
class Starts:
    """Beginnings of episodes, one after the other."""

    settled: Mapping[int, Reading]
    """The first time from each initial state, by index."""
    returned: Reading
    """The reference's initial state, after episodes from others."""
    fixtures: Array | None
    """(N, 3) m, in the first of them; None without a simulator of MuJoCo."""
    fixtures_later: Array | None
    """Likewise, at :attr:`returned`."""


def starts(subject: EnvironmentSubject) -> Starts:
    """Begin in a new environment from the reference's initial state, from 0, 1 and 2, and from the first."""
    init = subject.reference.init
    between = (0, 1, 2) if subject.chooses else ()
    subject.abandon()  # the first episode of an environment may differ from all others
    readings = {init: copied(subject.begin(init, drawn=True))}
    fixtures = subject.fixtures
    for index in between:
        reading = copied(subject.begin(index, drawn=True))
        readings.setdefault(index, reading)
    returned = copied(subject.begin(init, drawn=True))
    return Starts(readings, returned, fixtures, subject.fixtures)


class Moved(NamedTuple):
    """A movement of the hand."""

    way: Array
    """(3,) m, world."""
    turn: Array | None
    """(3,) rad, world; None without a quaternion."""


def moved(subject: EnvironmentSubject, action: Sequence[float], steps: int) -> Moved:
    """Return the movement under the same action for some steps, from the settled state."""
    before = copied(subject.begin())
    for _ in range(steps):
        after = subject.step(action).reading
    way = hand_of(after)[0] - hand_of(before)[0]
    if "quaternion" not in before:
        return Moved(way, None)
    return Moved(way, turn_between(before["quaternion"], after["quaternion"]))


def along_axes(subject: EnvironmentSubject) -> tuple[Moved, ...]:
    """Return the movements under +1 in the first three components."""
    return tuple(moved(subject, move.action, move.steps) for move in subject.reference.moves[:3])
