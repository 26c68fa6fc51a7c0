"""Every goal reached by hand: things are put where the task wants them, joints turned as it wants them."""

from __future__ import annotations

import mujoco
import numpy as np

from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.substrates.embedded.scene import Scene, joint_state, joints_of
from pytest_libero_max.tasks.libero_tasks import category_of
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.privileged import Fact

# Where an object's lowest point goes relative to a region's middle, in the axes of the fixture, m.
SPOTS = {
    "cook_region": (0.0, 0.0, 0.026),
    "top_side": (0.0, 0.0, 0.004),
    "top_region": (0.0, -0.02, -0.022),
    "bottom_region": (0.0, -0.02, -0.026),
    "basket_1_contain_region": (0.0, 0.0, -0.055),
    "back_contain_region": (0.0, 0.0, -0.054),
    "heating_region": (-0.05, -0.02, -0.082),
}
# Where a second object goes that wants the same region: both move aside by this much, m.
ASIDE = {"cook_region": (0.043, 0.0, 0.0), "basket_1_contain_region": (0.0, 0.034, 0.0)}
# Where the middle of an upright object is along y, seen from its origin, m.
MIDDLES = {"porcelain_mug": -0.0121, "white_yellow_mug": 0.0182, "black_book": -0.0122}
# A bottle in the rack: half its slope up from lying, its bottom a little above the lower end.
BOTTLE_LEAN = np.deg2rad(63.5)
BOTTLE_OVER_BOARD = 0.0235


def reach(scene: Scene, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Bring a state at rest into one where the whole goal should hold once things have settled."""
    for fact in (*(f for f in scene.task.goal if f.place is None), *opened(scene)):
        state = joint_state(fact, scene.entities, scene.regions)
        for joint in joints_of(fact.subject, scene.entities, scene.regions):
            low, high = model.joint(joint).range
            wanted = next(value for value in (state.low, state.high) if value is not None)
            data.joint(joint).qpos[0] = np.clip(wanted + (0.004 if state.high is None else -0.004), low, high)
    mujoco.mj_forward(model, data)
    done: dict[str, int] = {}
    for fact in scene.task.goal:
        if fact.place is not None:
            put(scene, data, fact.subject, fact.place, done.setdefault(fact.place, 0))
            done[fact.place] += 1
            mujoco.mj_forward(model, data)


def opened(scene: Scene) -> list[Fact]:
    """Drawers that must come out before something can be put into them and that the goal leaves open."""
    closed = {fact.subject for fact in scene.task.goal if fact.predicate == "close"}
    return [
        Fact("open", fact.place)
        for fact in scene.task.goal
        if fact.predicate == "in" and fact.place is not None
        if scene.regions[fact.place].joints and fact.place not in closed
    ]


def put(scene: Scene, data: mujoco.MjData, subject: str, place: str, number: int) -> None:
    """Put an object where the goal wants it; ``number`` counts the objects that are there already."""
    kind = category(category_of(subject))
    joint = data.joint(f"{subject}_joint0")
    joint.qpos[3:] = kind.upright
    if place in scene.task.places:
        joint.qpos[:3] = *data.site(place).xpos[:2], joint.qpos[2]
    elif place == "wine_rack_1_top_region":
        lean = rotations.about((1, 0, 0), BOTTLE_LEAN)
        uphill, outward = rotations.matrix(lean)[:, 2], rotations.matrix(lean)[:, 1]
        board = data.site(place).xpos + np.array([0.0, 0.0, -0.008])
        joint.qpos[:3] = board + 0.02 * uphill + BOTTLE_OVER_BOARD * outward
        joint.qpos[3:] = rotations.multiply(lean, kind.upright)
    elif place in scene.regions:
        key = next(key for key in SPOTS if place.endswith(key))
        frame = data.body(scene.entities[scene.regions[place].target].body).xmat.reshape(3, 3)
        shared = sum(other.place == place for other in scene.task.goal) > 1
        aside = (1 - 2 * number) * np.array(ASIDE[key]) if shared else np.zeros(3)
        spot = data.site(place).xpos + frame @ (np.array(SPOTS[key]) + aside)
        joint.qpos[:3] = spot + np.array([0.0, 0.0, kind.origin_height])
        joint.qpos[1] -= MIDDLES.get(kind.name, 0.0)
    else:
        drop = 0.045 if "bowl" in place else 0.012
        joint.qpos[:3] = data.body(scene.entities[place].body).xpos + np.array([0.005, -0.005, drop])
        joint.qpos[1] -= MIDDLES.get(kind.name, 0.0)
