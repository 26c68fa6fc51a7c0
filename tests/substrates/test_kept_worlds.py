"""Worlds that a substrate keeps."""

from __future__ import annotations

from typing import Any

from pytest_libero_max.substrates.kept_worlds import KeptWorlds


class Stand:
    """As much of a world as keeping needs."""

    def __init__(self, spoiled: bool = False) -> None:
        self.spoiled, self.open = spoiled, True

    def close(self) -> None:
        self.open = False


def test_the_worlds_that_were_used_last_stay() -> None:
    kept: Any = KeptWorlds()
    worlds = {name: Stand() for name in "abc"}
    kept.update(worlds)
    assert kept.used("a") is worlds["a"]
    assert kept.shrink(2)
    assert [*kept] == ["c", "a"]
    assert not kept.shrink(2)
    assert [name for name in worlds if worlds[name].open] == ["a", "c"]
    kept.close()
    assert not kept
    assert not any(world.open for world in worlds.values())


def test_a_spoiled_world_is_closed_and_not_used_again() -> None:
    kept: Any = KeptWorlds()
    spoiled = kept["a"] = Stand(spoiled=True)
    assert kept.used("a") is None
    assert not spoiled.open
    assert kept.used("a") is None
