"""The worlds that a substrate has built and keeps for reuse: those that were used last."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from pytest_libero_max.worlds.mujoco_world import MujocoWorld

Key = TypeVar("Key")
Kept = TypeVar("Kept", bound="MujocoWorld")


class KeptWorlds(dict[Key, Kept]):
    """Worlds by what tells their scenes apart, the one that was used last at the end."""

    def used(self, key: Key) -> Kept | None:
        """Return a kept world; None for none, or for one that a policy has spoiled, which is closed."""
        world = self.pop(key, None)
        if world is not None and world.spoiled:
            world.close()
            return None
        if world is not None:
            self[key] = world
        return world

    def shrink(self, most: int) -> bool:
        """Close the worlds that were not used for longest until so many are left; return True if any was."""
        closing = len(self) > most
        while len(self) > most:
            self.pop(next(iter(self))).close()
        return closing

    def close(self) -> None:
        """Close all."""
        self.shrink(0)
