"""LIBERO's goal predicates on a MuJoCo model and its data.

Each predicate is a small frozen value that names MuJoCo bodies, sites and joints, so that it survives a
rebuild of the model. The semantics, thresholds and their oddities are those of LIBERO: an object *is* its
body's origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    import mujoco


class Predicate(Protocol):
    """Something that holds or does not hold in a state whose positions and contacts are up to date."""

    def holds(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool: ...


def all_hold(goal: Sequence[Predicate], model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Return True if every predicate of a conjunction holds."""
    return all(predicate.holds(model, data) for predicate in goal)


@dataclass(frozen=True)
class In:
    """The object's origin lies inside a box site.

    The box is taken along the world axes: its half sizes are ``|R s|`` with the site's rotation ``R`` and
    size ``s``, and its lower face is 1 cm deeper.
    """

    body: str
    site: str

    def holds(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        centre, rotation, size = _site(model, data, self.site)
        half = np.abs(rotation @ size)
        offset = data.body(self.body).xpos - centre
        return bool(np.all(offset < half) and np.all(offset > -half - np.array([0.0, 0.0, 0.01])))


@dataclass(frozen=True)
class OnSite:
    """The object's origin lies over a site, at most 10 cm above it."""

    body: str
    site: str
    """A region of a fixture or of the table or floor."""
    fixture: str | None = None
    """Root body of the fixture that must touch the object; None for table and floor, where LIBERO asks for no
    contact."""

    def holds(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        centre, rotation, size = _site(model, data, self.site)
        # R and not its transpose, as LIBERO has it.
        x, y, z = rotation @ (data.body(self.body).xpos - centre)
        above = abs(x) < size[0] and abs(y) < size[1] and size[2] - 0.005 < z < size[2] + 0.10
        return bool(above) and (self.fixture is None or touching(model, data, self.body, self.fixture))


@dataclass(frozen=True)
class OnObject:
    """The object touches its support, whose origin is not higher and less than 3 cm away horizontally."""

    body: str
    support: str

    def holds(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        upper, lower = data.body(self.body).xpos, data.body(self.support).xpos
        near = lower[2] <= upper[2] and np.linalg.norm(upper[:2] - lower[:2]) < 0.03
        return bool(near) and touching(model, data, self.body, self.support)


@dataclass(frozen=True)
class Joints:
    """Drawers, doors and knobs: joint positions compared with a threshold."""

    joints: tuple[str, ...]
    """Names of the joints that belong to the region or fixture."""
    low: float | None = None
    """Holds above it; None for no lower bound."""
    high: float | None = None
    """Holds below it; None for no upper bound."""
    every: bool = False
    """True if all joints must comply (close, turn off); one is enough otherwise (open, turn on)."""
    closed: bool = False
    """True if equality with a bound counts."""

    def holds(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        complying = [self._complies(float(data.joint(name).qpos[0])) for name in self.joints]
        return all(complying) if self.every else any(complying)

    def _complies(self, position: float) -> bool:
        if self.closed and position in (self.low, self.high):
            return True
        return (self.low is None or position > self.low) and (self.high is None or position < self.high)


def touching(model: mujoco.MjModel, data: mujoco.MjData, first: str, second: str) -> bool:
    """Return True if any geom under the root body ``first`` is in contact with one under ``second``."""
    one, other = model.body(first).id, model.body(second).id
    roots = model.body_rootid[model.geom_bodyid[data.contact.geom[: data.ncon]]]
    if len(roots) == 0:
        return False
    return bool(np.any((roots == (one, other)).all(axis=1) | (roots == (other, one)).all(axis=1)))


def _site(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    site = data.site(name)
    return site.xpos, site.xmat.reshape(3, 3), model.site(name).size
