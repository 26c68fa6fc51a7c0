"""LIBERO-PRO's changes of a scene, made after the initial state has been set as its published runtime does.

- ``object_appearance`` tints. The texture stays: the runtime takes it off a material whose copy on the
  graphics card keeps it.
- ``object_shape`` does nothing, and an occluder keeps its size. The runtime scales meshes of a model that has
  been compiled already, which changes neither the picture nor the collisions.
- ``object_placement`` looks for a free place in front of the target, puts an occluder there, and puts it back
  there after every step, at the height at which the scene's own reset had left it.
- ``initial_pose`` looks for a free place away from where the target is and turns it.
- ``lighting`` and ``camera`` set absolute values.
- ``observation`` darkens every image of every camera and adds noise, the same at every step, whose seed is
  the case's.

The runtime observes the scene after each of them, which shifts the sampling of later observations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from pytest_libero_max.substrates.libero.placing import (
    objects,
    offsets,
    put_where_free,
    radius,
    require_free,
    shifts,
)
from pytest_libero_max.substrates.libero.pro_config import Config, Section
from pytest_libero_max.worlds.contract import Array, Image
from pytest_libero_max.worlds.robot import CAMERAS

import mujoco  # isort: skip - the rooms above have settled its backend

if TYPE_CHECKING:
    from pytest_libero_max.substrates.libero.world import LiberoWorld

_VISIBLE = 1
"""The geom group that is drawn and does not collide."""


@dataclass(frozen=True)
class ProVariation:
    """Changes that the published runtime makes once an initial state has been set."""

    config: Config
    """The sections of :mod:`.pro_config` to apply."""
    seed: int
    """Seed of the pictures' noise."""

    def apply(self, world: LiberoWorld) -> None:
        """Make the changes to a world that has just been reset, in the runtime's order.

        Raises:
            SubstrateError: Something that is to be moved finds no free place.
        """
        for name, act in _ACTS.items():
            if name in self.config:
                act(world, self.config[name])
                world.look()
        if "observation" in self.config:
            section = self.config["observation"]
            world.add_filter(DarkNoise(section["brightness"][0], section["sigma"][0], self.seed))


@dataclass(frozen=True)
class DarkNoise:
    """Darken every image of a camera and add the same noise to each."""

    brightness: float
    """Factor of all values."""
    sigma: float
    """Standard deviation of the noise, grey levels of 255."""
    seed: int
    """Of the agent's view; each further camera's is one more."""

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        if camera not in CAMERAS:
            return image  # no policy sees it
        stream = np.random.default_rng(self.seed + CAMERAS.index(camera))
        noisy = image.astype(np.float32) * self.brightness + stream.normal(0.0, self.sigma, image.shape)
        result: Image = np.clip(noisy, 0, 255).astype(np.uint8)
        return result


def _tint(world: LiberoWorld, section: Section) -> None:
    model = world.model
    for entity in section["targets"]:
        geoms = [int(geom) for geom in world.geoms(entity) if model.geom_group[geom] == _VISIBLE]
        for geom in geoms:
            world.alter("geom_rgba", geom, section["rgba"])
        for material in sorted({int(model.geom_matid[geom]) for geom in geoms} - {-1}):
            world.alter("mat_rgba", material, section["rgba"])


def _resize(world: LiberoWorld, section: Section) -> None:
    """Do nothing; see the module's docstring."""


def _occlude(world: LiberoWorld, section: Section) -> None:
    (target,), (occluder,) = section["reference"], section["targets"]
    world.look()  # after it has tried to enlarge the occluder
    centre = world.position(target)[:2]
    moved = [occluder]
    for between in section.get("between_object", ()):
        there = world.position(between)[:2]
        if float(np.linalg.norm(there - centre)) < section["min_between_distance"][0]:
            ways = shifts(section["between_delta_xy"])
            put_where_free(world, between, [there + way for way in ways], world.pose(between))
            world.look()
            moved.append(between)
    avoided = [name for name in section.get("avoid_targets", ()) if name in objects(world)]

    def suits(place: Array) -> bool:
        margins = [(centre, section["min_reference_distance"][0])]
        for name in avoided:
            margin = radius(world, occluder) + radius(world, name) + section["min_avoid_distance"][0]
            margins.append((world.position(name)[:2], margin))
        return all(float(np.linalg.norm(place - other)) >= margin for other, margin in margins)

    position = world.position(occluder)
    position[2] += section["z_offset"][0]
    candidates = [centre + offset for offset in offsets(section["offsets_xy"], section["front_direction"])]
    put_where_free(world, occluder, candidates, (position, np.array(section["target_quat"])), suits)
    world.look()
    require_free(world, *moved)
    world.pin(occluder)


def _start_elsewhere(world: LiberoWorld, section: Section) -> None:
    (target,), half = section["target"], section["yaw"][0] / 2
    position = world.position(target)
    upright = np.array([math.cos(half), 0.0, 0.0, math.sin(half)])
    ways = shifts(section["delta_xy"], section["min_delta_norm"][0])
    put_where_free(world, target, [position[:2] + way for way in ways], (position, upright))
    require_free(world, target)


def _light(world: LiberoWorld, section: Section) -> None:
    world.alter("light_active", slice(None), 1)
    for kind in ("ambient", "diffuse", "specular"):
        world.alter(f"light_{kind}", slice(None), section[kind])


def _view(world: LiberoWorld, section: Section) -> None:
    camera = mujoco.mj_name2id(world.model, mujoco.mjtObj.mjOBJ_CAMERA, section["name"][0])
    world.alter("cam_pos", camera, section["pos"])
    world.alter("cam_quat", camera, section["quat"])


_ACTS: Mapping[str, Callable[[LiberoWorld, Section], None]] = MappingProxyType(
    {
        "object_appearance": _tint,
        "object_shape": _resize,
        "object_placement": _occlude,
        "initial_pose": _start_elsewhere,
        "lighting": _light,
        "camera": _view,
    }
)
