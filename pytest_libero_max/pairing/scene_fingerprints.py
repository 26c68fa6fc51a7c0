"""Fingerprints of the scene of a pair. Importing this imports no simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_libero_max.worlds.contract import World

SCENE, START = "scene", "start"
"""Names of the fingerprints."""


def scene_fingerprints(world: World, init: int) -> dict[str, str]:
    """Return the fingerprints of the scene that a pair plays; resets the world, or raise SubstrateError.

    ``scene`` is the key of the scene and the digest of all that no reset changes, which all pairs of the
    scene have in common. ``start`` is the digest of the state after the reset, the source variation's changes
    included.
    """
    from pytest_libero_max.worlds.scene_digest import combined, state_fields

    world.reset(init)
    start = combined(state_fields(world.snapshot()))
    return {SCENE: f"{world.scene} {combined(world.scene_fields())}", START: start}
