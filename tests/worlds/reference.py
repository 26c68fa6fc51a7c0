"""Robosuite itself, put into the state of an embedded world, to be stepped beside it."""

from __future__ import annotations

from pytest_libero_max.substrates.embedded.env import SceneEnv
from pytest_libero_max.substrates.embedded.scene import Scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld


def twin(scene: Scene, world: EmbeddedWorld) -> SceneEnv:
    """A robosuite environment of the same scene in the same state, its controller included."""
    env = SceneEnv(scene)
    env.reset()
    env.assume(world.snapshot())
    return env
