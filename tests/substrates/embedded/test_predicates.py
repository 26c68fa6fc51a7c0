"""Every predicate on a world of two boxes, and every goal in its own scene."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import pytest

from pytest_libero_max.substrates.embedded.predicates import In, Joints, OnObject, OnSite, all_hold, touching
from tests.mujoco_line import LINE

from .goals import reach
from .scenes import ALL, IDS, at_start, control_steps

BOXES = """
<mujoco><worldbody>
  <body name="stand" pos="0 0 0.5">
    <geom type="box" size="0.2 0.2 0.1"/>
    <site name="top" type="box" pos="0 0 0.1" size="0.1 0.05 0.01" euler="0 0 30"/>
    <site name="inside" type="box" pos="1 0 0" size="0.1 0.2 0.3" quat="0.7071068 0 0.7071068 0"/>
    <body name="lid"><joint name="lid" type="slide" axis="0 0 1" range="-1 1" limited="true"/>
      <geom type="sphere" size="0.01" pos="5 0 0"/></body>
    <body name="flap"><joint name="flap" type="slide" axis="0 0 1" range="-1 1" limited="true"/>
      <geom type="sphere" size="0.01" pos="-5 0 0"/></body>
  </body>
  <body name="cube"><joint name="cube" type="free"/><geom type="box" size="0.02 0.02 0.02"/></body>
</worldbody></mujoco>"""
TOUCHING = 0.61999
"""Height at which the cube rests on the stand, m."""

Boxes = Callable[[float, float, float], tuple[mujoco.MjModel, mujoco.MjData]]


@pytest.fixture
def boxes() -> Boxes:
    model = mujoco.MjModel.from_xml_string(BOXES)
    data = mujoco.MjData(model)

    def put(x: float, y: float, z: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
        data.joint("cube").qpos[:3] = x, y, z
        mujoco.mj_forward(model, data)
        return model, data

    return put


def test_touching_is_symmetric_and_ends_with_the_contact(boxes: Boxes) -> None:
    assert touching(*boxes(0, 0, TOUCHING), "cube", "stand")
    assert touching(*boxes(0, 0, TOUCHING), "stand", "cube")
    assert not touching(*boxes(0, 0, 0.63), "cube", "stand")


@pytest.mark.parametrize(
    ("x", "z", "expected"),
    [(0.0, TOUCHING, True), (0.029, TOUCHING, True), (0.031, TOUCHING, False), (0.0, 0.63, False)],
)
def test_on_object_needs_contact_and_less_than_three_centimetres(
    boxes: Boxes, x: float, z: float, expected: bool
) -> None:
    assert OnObject("cube", "stand").holds(*boxes(x, 0, z)) is expected


def test_on_object_needs_the_support_to_be_below(boxes: Boxes) -> None:
    model, data = boxes(0, 0, 0.3801)  # the cube touches the stand from underneath
    assert touching(model, data, "cube", "stand")
    assert not OnObject("cube", "stand").holds(model, data)


def test_on_site_asks_for_contact_only_where_a_fixture_is_named(boxes: Boxes) -> None:
    floating = boxes(0, 0, 0.66)
    assert OnSite("cube", "top").holds(*floating)
    assert not OnSite("cube", "top", "stand").holds(*floating)
    assert OnSite("cube", "top", "stand").holds(*boxes(0, 0, TOUCHING))


@pytest.mark.parametrize(("z", "expected"), [(0.604, False), (0.606, True), (0.709, True), (0.711, False)])
def test_on_site_has_a_height_of_its_own(boxes: Boxes, z: float, expected: bool) -> None:
    # The site is 1 cm thick to either side of 0.6: from 5 mm under its top to 10 cm above its top.
    assert OnSite("cube", "top").holds(*boxes(0, 0, z)) is expected


def test_on_site_turns_the_offset_by_the_sites_own_rotation(boxes: Boxes) -> None:
    # LIBERO multiplies by R, where R transposed would bring the offset into the site's frame: at 30 degrees
    # a point on the site's long axis ends up at 60 degrees, outside the narrow side.
    assert not OnSite("cube", "top").holds(*boxes(0.0779, 0.045, 0.62))
    assert OnSite("cube", "top").holds(*boxes(0.0779, -0.045, 0.62))


@pytest.mark.parametrize(
    ("x", "y", "z", "expected"),
    [
        (1.29, 0, 0.5, True),
        (1.31, 0, 0.5, False),
        (1.0, 0.19, 0.5, True),
        (1.0, 0.21, 0.5, False),
        (1.0, 0, 0.599, True),
        (1.0, 0, 0.601, False),
        (1.0, 0, 0.391, True),
        (1.0, 0, 0.389, False),
    ],
)
def test_in_uses_the_turned_box_and_a_centimetre_more_below(
    boxes: Boxes, x: float, y: float, z: float, expected: bool
) -> None:
    assert In("cube", "inside").holds(*boxes(x, y, z)) is expected


@pytest.mark.parametrize(
    ("predicate", "lid", "flap", "expected"),
    [
        (Joints(("lid", "flap"), high=-0.14), -0.15, 0.0, True),
        (Joints(("lid", "flap"), high=-0.14), -0.14, 0.0, False),
        (Joints(("lid", "flap"), low=0.0, every=True), 0.01, 0.01, True),
        (Joints(("lid", "flap"), low=0.0, every=True), 0.01, 0.0, False),
        (Joints(("lid",), low=0.5, closed=True), 0.5, 0.0, True),
        (Joints(("lid",), low=0.5, closed=True), 0.49, 0.0, False),
        (Joints(("lid",), high=0.0, every=True), 0.0, 0.0, False),
        (Joints(("lid",), high=0.0, every=True), -0.001, 0.0, True),
    ],
)
def test_joints_compare_with_their_thresholds(
    boxes: Boxes, predicate: Joints, lid: float, flap: float, expected: bool
) -> None:
    model, data = boxes(0, 0, 1)
    data.joint("lid").qpos[0], data.joint("flap").qpos[0] = lid, flap
    assert predicate.holds(model, data) is expected


def test_a_goal_is_a_conjunction(boxes: Boxes) -> None:
    state = boxes(0, 0, TOUCHING)
    on, into = OnObject("cube", "stand"), In("cube", "inside")
    assert all_hold((on,), *state)
    assert not all_hold((on, into), *state)


@pytest.mark.parametrize(("suite", "index"), ALL, ids=IDS)
def test_a_goal_does_not_hold_at_any_start(suite: str, index: int) -> None:
    for init in range(10):
        scene, model, data = at_start(suite, index, init)
        assert not all_hold(scene.goal, model, data)


@pytest.mark.parametrize(("suite", "index"), ALL, ids=IDS)
def test_a_goal_holds_once_the_task_was_done_by_hand(suite: str, index: int) -> None:
    if LINE != "3.3" and (suite, index) in (("libero_10", 1), ("libero_10", 9)):
        pytest.skip("what is put down here comes to rest elsewhere with a later MuJoCo")
    scene, model, data = at_start(suite, index)
    reach(scene, model, data)
    control_steps(model, data, 20)
    mujoco.mj_forward(model, data)
    assert all_hold(scene.goal, model, data)
    control_steps(model, data, 20)
    assert all_hold(scene.goal, model, data)
