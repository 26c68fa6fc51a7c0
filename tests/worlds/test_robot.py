"""Robots say how their gripper opens, and whose each body is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pytest_libero_max.substrates.tiny import world as tiny
from pytest_libero_max.worlds.robot import PANDA, Robot


@pytest.mark.parametrize(
    ("at_rest", "command", "closes"),
    [
        (-1.0, 0.5, True),
        (-1.0, 0.0, False),
        (-1.0, -1.0, False),
        (0.0, 1.0, True),
        (1.0, -0.5, True),
        (1.0, 0.0, False),
        (1.0, 1.0, False),
    ],
)
def test_the_no_op_says_how_the_gripper_opens(at_rest: float, command: float, closes: bool) -> None:
    robot = Robot(name="hand", noop=(0.0, 0.0, 0.0, at_rest))
    assert robot.closes((1.0, 1.0, 1.0, command)) == closes


def test_the_panda_closes_with_what_is_above_zero() -> None:
    assert PANDA.opening == -1.0


def test_contacts_have_the_names_that_the_robot_gives_its_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    names = {}
    for owners in ({"gripper0_left*": "robot0", "gripper0_*": "gripper0"}, {}):
        monkeypatch.setattr(tiny, "_HAND", replace(tiny._HAND, owners=owners))
        world = tiny.TinyWorld()
        world.place("box_1", world.end_effector())
        names[len(owners)] = {*world.contacts("box_1")}
        world.close()
    assert names == {2: {"gripper0", "robot0"}, 0: set()}


def test_what_can_be_touched_is_what_collides() -> None:
    world = tiny.TinyWorld()
    height = world.top_m("main_table")
    assert height == pytest.approx(tiny.TABLE_TOP_M)
    world.model.geom_contype[world.geoms("main_table")] = 0
    world.model.geom_conaffinity[world.geoms("main_table")] = 0
    assert world.top_m("main_table") is None
    world.close()
