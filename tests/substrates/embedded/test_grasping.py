"""Every object that a task asks for can be pinched by the Panda's fingers, lifted, carried and held.

The gripper is a free-standing pair of fingers with the pads, forces and inertias of robosuite's Panda
gripper.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest

from pytest_libero_max.substrates.embedded.objects import CATEGORIES, category, parts
from pytest_libero_max.worlds import rotations

PAD = 'type="box" size="0.008 0.004 0.008" solref="0.01 0.5" friction="2 0.05 0.0001"'
FINGER = 'type="box" size="0.009 0.006 0.02" condim="4" friction="1 0.005 0.0001"'
GRIPPER = f"""
<body name="hand" pos="0 0 0.3" gravcomp="1">
  <joint name="x" type="slide" axis="1 0 0" damping="1000"/>
  <joint name="y" type="slide" axis="0 1 0" damping="1000"/>
  <joint name="z" type="slide" axis="0 0 1" damping="1000"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
  <body name="left" gravcomp="1">
    <joint name="left" type="slide" axis="0 1 0" range="0 0.04" damping="100" armature="1" frictionloss="1"/>
    <inertial pos="0 0 0" mass="0.1" diaginertia="0.01 0.01 0.005"/>
    <geom {PAD} pos="0 0.004 0"/><geom {FINGER} pos="0 0.0145 0.022"/>
  </body>
  <body name="right" gravcomp="1">
    <joint name="right" type="slide" axis="0 1 0" range="-0.04 0" damping="100" armature="1"
    frictionloss="1"/> <inertial pos="0 0 0" mass="0.1" diaginertia="0.01 0.01 0.005"/> <geom {PAD} pos="0
    -0.004 0"/><geom {FINGER} pos="0 -0.0145 0.022"/>
  </body>
</body>"""
ACTUATORS = """
<actuator>
  <position joint="x" kp="20000"/><position joint="y" kp="20000"/><position joint="z" kp="20000"/>
  <position joint="left" kp="1000" ctrlrange="0 0.04" forcerange="-20 20"/>
  <position joint="right" kp="1000" ctrlrange="-0.04 0" forcerange="-20 20"/>
</actuator>"""

# Category, offset along y from the object's middle, height of the pads above the ground.
GRASPS = [
    ("akita_black_bowl", 0.051, 0.040),
    ("akita_black_bowl", -0.051, 0.040),
    ("glazed_rim_porcelain_ramekin", 0.042, 0.030),
    ("alphabet_soup", 0.0, 0.045),
    ("tomato_sauce", 0.0, 0.045),
    ("cream_cheese", 0.0, 0.012),
    ("butter", 0.0, 0.012),
    ("chocolate_pudding", 0.0, 0.014),
    ("cookies", 0.0, 0.012),
    ("milk", 0.0, 0.075),
    ("orange_juice", 0.0, 0.075),
    ("ketchup", 0.0, 0.065),
    ("salad_dressing", 0.0, 0.065),
    ("bbq_sauce", 0.0, 0.05),
]
# Parts that the objects themselves name.
PARTS = [
    ("black_book", "spine"),
    ("chefmate_8_frypan", "handle"),
    ("moka_pot", "handle"),
    ("moka_pot", "handle_top"),
    ("moka_pot", "knob"),
    ("porcelain_mug", "handle"),
    ("porcelain_mug", "rim_across"),
    ("porcelain_mug", "rim_back"),
    ("porcelain_mug", "rim_front"),
    ("red_coffee_mug", "handle"),
    ("red_coffee_mug", "rim_across"),
    ("red_coffee_mug", "rim_back"),
    ("red_coffee_mug", "rim_front"),
    ("white_yellow_mug", "handle"),
    ("white_yellow_mug", "rim_across"),
    ("white_yellow_mug", "rim_back"),
    ("white_yellow_mug", "rim_front"),
    ("wine_bottle", "body"),
    ("wine_bottle", "neck"),
]


def grasp_model(name: str, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> mujoco.MjModel:
    """The object at (x, y), turned about z, under a gripper whose fingers close along y."""
    kind = category(name)
    quat = rotations.multiply(rotations.about((0, 0, 1), turn), kind.upright)
    elements, _ = parts.assets(kind)
    assets = "".join(ET.tostring(element, encoding="unicode") for element in elements)
    body = ET.tostring(parts.body(kind, "thing_1", (x, y, kind.origin_height), quat), encoding="unicode")
    return mujoco.MjModel.from_xml_string(f"""
      <mujoco><compiler angle="radian" autolimits="true" inertiagrouprange="0 0"/> <option timestep="0.002"
      cone="elliptic" impratio="20"/> <asset>{assets}</asset> <worldbody><geom type="plane" size="2 2 0.1"
      friction="1 0.005 0.0001"/>{body}{GRIPPER}</worldbody>{ACTUATORS}</mujoco>""")


def drive(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    target: tuple[float, float, float],
    opening: float,
    seconds: float,
) -> None:
    start = data.ctrl[:3].copy()
    steps = int(seconds / model.opt.timestep)
    for step in range(steps):
        share = min(1.0, 1.5 * (step + 1) / steps)
        data.ctrl[:3] = start + (np.asarray(target) - start) * share
        data.ctrl[3:] = opening, -opening
        mujoco.mj_step(model, data)


@pytest.mark.parametrize(
    ("name", "side", "height"),
    GRASPS,
    ids=[f"{name}{side:+.3f}@{height:.3f}" for name, side, height in GRASPS],
)
def test_is_lifted_carried_and_held(name: str, side: float, height: float) -> None:
    carry(grasp_model(name), side, height)


def test_every_part_to_grasp_is_tried() -> None:
    kinds = {name: category(name) for name in CATEGORIES if not category(name).fixture}
    assert sorted((name, grip.name) for name, kind in kinds.items() for grip in kind.root.grips) == PARTS


@pytest.mark.parametrize(("name", "part"), PARTS, ids=[f"{name}-{part}" for name, part in PARTS])
def test_is_lifted_carried_and_held_by_its_part(name: str, part: str) -> None:
    kind = category(name)
    (grip,) = (grip for grip in kind.root.grips if grip.name == part)
    across = np.cross(grip.along, grip.out)
    turn = np.pi / 2 - np.arctan2(across[1], across[0])
    offset = rotations.matrix(rotations.about((0, 0, 1), turn)) @ grip.pos
    model = grasp_model(name, -offset[0], -offset[1], turn)
    carry(model, 0.0, grip.pos[2] + kind.origin_height)


def carry(model: mujoco.MjModel, side: float, height: float) -> None:
    """Pinch at y = ``side``, lift, carry and put down, and check that the object came along each time."""
    data = mujoco.MjData(model)
    down = height - 0.3
    data.joint("left").qpos[0], data.joint("right").qpos[0] = 0.04, -0.04
    drive(model, data, (0.0, side, 0.0), 0.04, 0.4)
    drive(model, data, (0.0, side, down), 0.04, 0.6)
    drive(model, data, (0.0, side, down), 0.0, 0.6)
    before = data.body("thing_1_main").xpos.copy()
    drive(model, data, (0.0, side, down + 0.15), 0.0, 0.8)
    lifted = data.body("thing_1_main").xpos[2] - before[2]
    assert lifted == pytest.approx(0.15, abs=0.02)
    drive(model, data, (0.15, side - 0.15, down + 0.15), 0.0, 1.0)
    drive(model, data, (0.15, side - 0.15, down + 0.15), 0.0, 1.0)
    carried = data.body("thing_1_main").xpos - before
    assert carried == pytest.approx([0.15, -0.15, 0.15], abs=0.03)
    drive(model, data, (0.15, side - 0.15, down + 0.004), 0.0, 0.8)
    drive(model, data, (0.15, side - 0.15, down + 0.004), 0.04, 0.6)
    drive(model, data, (0.15, side - 0.15, 0.0), 0.04, 0.8)
    released = data.body("thing_1_main")
    assert released.xpos == pytest.approx(before + np.array([0.15, -0.15, 0.0]), abs=0.02)
    assert abs(data.joint("thing_1_joint0").qvel).max() < 0.01
