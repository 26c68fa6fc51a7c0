"""A world that costs almost nothing, for tests of changes, policies, runners and adapters.

It plays the whole contract of :class:`~pytest_libero_max.worlds.contract.World` on plain MuJoCo: a
table, a box to move, a plate to move it to, five small things in the way, a cabinet with a drawer, a
hand that floats where the actions push it, LIBERO's two cameras, two lights without shadows. A control step
takes some tenths of a millisecond, building it and an image a few. It has no arm and no LIBERO task:
invariants that hold here are meant to hold everywhere, measurements of policies here mean nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.contract import Array, Entity
from pytest_libero_max.worlds.mujoco_world import MujocoWorld
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.robot import GRIPPER, PANDA, MujocoRobot

gl.prepare()

import mujoco  # noqa: E402

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.worlds.rendering.renderer import Renderer

INITS = 10
"""Number of initial states."""

LANGUAGE = "put the box on the plate"
TABLE_TOP_M = 0.4
STEP_M = 0.05
"""Distance that a control step at full deflection moves the hand, as with LIBERO's controller."""

_SUBSTEPS = 3  # with fewer, the fingers do not hold the box
_REACH_M = (0.35, 0.35, 0.35)
_HAND_START_M = (0.0, -0.25, TABLE_TOP_M + 0.25)
"""World position from which the hand's joints measure."""

_CLUTTER = MappingProxyType(
    {
        "clutter_1": ("0.02 0.02 0.02", "0.9 0.5 0.1 1"),
        "clutter_2": ("0.015 0.02 0.03", "0.2 0.7 0.3 1"),
        "clutter_3": ("0.025 0.02 0.015", "0.6 0.2 0.7 1"),
        "clutter_4": ("0.02 0.015 0.03", "0.9 0.9 0.2 1"),
        "clutter_5": ("0.03 0.02 0.015", "0.2 0.7 0.8 1"),
    }
)
"""Half sizes in m and colours. All shapes that rest on something are boxes: nothing rolls or rocks."""


def _clutter_xml() -> str:
    bodies = []
    for number, (name, (size, colour)) in enumerate(_CLUTTER.items()):
        place = f"{0.12 * number - 0.24:.2f} 0.3 {TABLE_TOP_M + float(size.split()[2])}"
        bodies.append(
            f'<body name="{name}_main" pos="{place}"><freejoint name="{name}_joint0"/>'
            f'<geom type="box" size="{size}" rgba="{colour}" mass="0.05"/></body>'
        )
    return "\n    ".join(bodies)


_MJCF = f"""
<mujoco model="tiny">
  <option timestep="{0.05 / _SUBSTEPS}" cone="elliptic" impratio="10"/>
  <visual><global offwidth="256" offheight="256"/></visual>
  <default><geom group="1" condim="4" solref="0.01 1"/><light castshadow="false"/></default>
  <asset>
    <texture name="check" type="2d" builtin="checker" width="64" height="64" rgb1=".7 .6 .5" rgb2=".5 .4 .3"/>
    <material name="wood" texture="check" texrepeat="4 4"/>
    <material name="plain" rgba="0.8 0.2 0.2 1"/>
  </asset>
  <worldbody>
    <light name="light1" pos="1 1 3" dir="-0.3 -0.3 -1" diffuse="0.6 0.6 0.6" ambient="0.2 0.2 0.2"/>
    <light name="light2" pos="-1 -1 3" dir="0.3 0.3 -1" diffuse="0.4 0.4 0.4"/>
    <camera name="agentview" pos="1.0 0 1.1" xyaxes="0 1 0 -0.6 0 0.8" fovy="45"/>
    <geom name="floor" type="box" pos="0 0 -0.1" size="3 3 0.1" rgba="0.4 0.4 0.45 1"/>
    <body name="table" pos="0 0 {TABLE_TOP_M - 0.02}">
      <geom name="table_top" type="box" size="0.45 0.45 0.02" material="wood"/>
    </body>
    <body name="cabinet_1_main" pos="-0.35 0 {TABLE_TOP_M}">
      <geom type="box" size="0.08 0.1 0.01" pos="0 0 0.01" rgba="0.5 0.35 0.2 1"/>
      <geom type="box" size="0.08 0.1 0.01" pos="0 0 0.13" rgba="0.5 0.35 0.2 1"/>
      <body name="cabinet_1_drawer" pos="0 0 0.07">
        <joint name="cabinet_1_slide" type="slide" axis="1 0 0" range="0 0.1" damping="5"/>
        <geom type="box" size="0.07 0.09 0.035" rgba="0.6 0.45 0.3 1" mass="0.5"/>
      </body>
    </body>
    <body name="box_1_main" pos="0.1 -0.1 {TABLE_TOP_M + 0.03}">
      <freejoint name="box_1_joint0"/>
      <geom type="box" size="0.03 0.03 0.03" material="plain" mass="0.1"/>
    </body>
    <body name="plate_1_main" pos="0.1 0.15 {TABLE_TOP_M + 0.01}">
      <freejoint name="plate_1_joint0"/>
      <geom type="box" size="0.08 0.08 0.01" rgba="0.85 0.85 0.9 1" mass="0.2"/>
    </body>
    {_clutter_xml()}
    <body name="gripper0_hand" pos="{" ".join(map(str, _HAND_START_M))}" gravcomp="1">
      <joint name="hand_x" type="slide" axis="1 0 0" damping="20"/>
      <joint name="hand_y" type="slide" axis="0 1 0" damping="20"/>
      <joint name="hand_z" type="slide" axis="0 0 1" damping="20"/>
      <camera name="robot0_eye_in_hand" pos="0.06 0 0.08" quat="0.7071068 0 0 -0.7071068" fovy="75"/>
      <geom type="box" size="0.03 0.05 0.02" pos="0 0 0.06" rgba="0.9 0.9 0.9 1" mass="0.5"/>
      <site name="gripper0_grip_site" size="0.005" rgba="0 0 0 0"/>
      <body name="gripper0_left" pos="0 -0.01 0.02" gravcomp="1">
        <joint name="finger_1" type="slide" axis="0 -1 0" range="0 0.04" damping="10"/>
        <geom type="box" size="0.008 0.006 0.025" rgba="0.3 0.3 0.3 1" mass="0.05"/>
      </body>
      <body name="gripper0_right" pos="0 0.01 0.02" gravcomp="1">
        <joint name="finger_2" type="slide" axis="0 -1 0" range="-0.04 0" damping="10"/>
        <geom type="box" size="0.008 0.006 0.025" rgba="0.3 0.3 0.3 1" mass="0.05"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="hand_x" joint="hand_x" kp="400" forcerange="-40 40"/>
    <position name="hand_y" joint="hand_y" kp="400" forcerange="-40 40"/>
    <position name="hand_z" joint="hand_z" kp="400" forcerange="-40 40"/>
    <position name="finger_1" joint="finger_1" kp="200" forcerange="-5 5"/>
    <position name="finger_2" joint="finger_2" kp="200" forcerange="-5 5"/>
  </actuator>
</mujoco>
"""

_ENTITIES = MappingProxyType(
    {
        entity.name: entity
        for entity in (
            Entity("box_1", "box", "object", "box_1_main", support="main_table"),
            Entity("plate_1", "plate", "object", "plate_1_main", support="main_table"),
            *(Entity(name, "clutter", "object", f"{name}_main", support="main_table") for name in _CLUTTER),
            Entity("cabinet_1", "cabinet", "fixture", "cabinet_1_main", support="main_table"),
            Entity("main_table", "table", "surface", "table"),
        )
    }
)

_HAND = MujocoRobot(
    name=PANDA.name,  # it takes the actions of LIBERO's arm, and shows its state
    state=PANDA.state,
    arm_joints=("hand_x", "hand_y", "hand_z"),
    finger_joints=("finger_1", "finger_2"),
    hand_body=f"{GRIPPER}_hand",
)


class TinyWorld(MujocoWorld):
    """A floating hand over a table; see the module's text.

    Actions are LIBERO's: the first three components move the hand (clipped to +-1, 5 cm at most) or, under
    absolute control, say where it shall be (m), the next three are accepted and without effect, the seventh
    opens (negative) or closes (positive) the fingers. The task is solved while ``box_1`` rests on
    ``plate_1``.
    """

    def __init__(self) -> None:
        model = mujoco.MjModel.from_xml_string(_MJCF)
        super().__init__("tiny/0", LANGUAGE, model, mujoco.MjData(model), _ENTITIES, _HAND)
        self._site = int(model.site(_HAND.grip_site).id)
        self._hand = [int(model.joint(name).qposadr[0]) for name in _HAND.arm_joints]
        self._hand_dofs = [int(model.joint(name).dofadr[0]) for name in _HAND.arm_joints]
        self._hand_body = int(model.body(_HAND.hand_body).id)
        self._fingers = [int(model.joint(name).qposadr[0]) for name in _HAND.finger_joints]
        self._finger_dofs = [int(model.joint(name).dofadr[0]) for name in _HAND.finger_joints]
        self._opening = 0.0
        self._other: TinyWorld | None = None
        self.reset(0)

    def _initial_qpos(self, init: int) -> Array:
        if not 0 <= init < INITS:
            raise SubstrateError.seen("init", init, f": the tiny world has initial states 0 to {INITS - 1}.")
        qpos: Array = self._model.qpos0.copy()
        for name, sway in (("box_1", 0.008), ("plate_1", -0.006)):
            qpos[self._qpos_address(name)] += sway * (init % 5)
            qpos[self._qpos_address(name) + 1] += sway * (init // 5)
        return qpos

    def _reset_controller(self) -> None:
        self._opening = 0.0

    def _controller_state(self) -> Array:
        return np.array([self._opening])

    def _set_controller_state(self, state: Array) -> None:
        self._opening = float(state[0])

    def _control_step(self, action: Array) -> bool:
        self._opening = float(np.clip(self._opening - 0.25 * np.sign(action[6]), -1.0, 1.0))
        if self._control == "absolute":
            target = action[:3] - _HAND_START_M
        else:
            target = self._data.qpos[self._hand] + STEP_M * np.clip(action[:3], -1.0, 1.0)
        self._data.ctrl[:3] = np.clip(target, np.negative(_REACH_M), _REACH_M)
        self._data.ctrl[3:] = (0.02 * (1.0 + self._opening), -0.02 * (1.0 + self._opening))
        mujoco.mj_step(self._model, self._data, _SUBSTEPS)
        self._settle()
        return False

    def _proprioception(self) -> dict[str, Array]:
        joints, velocities = np.zeros((2, self._robot.state[self._robot.joints_key]))
        joints[:3], velocities[:3] = self._data.qpos[self._hand], self._data.qvel[self._hand_dofs]
        values = (
            self.end_effector(),
            np.roll(self._data.xquat[self._hand_body], -1),
            self._data.qpos[self._fingers],
            self._data.qvel[self._finger_dofs],
            joints,
            velocities,
        )
        return dict(zip(self._robot.state, values, strict=True))

    def end_effector(self) -> Array:
        position: Array = self._data.site_xpos[self._site].copy()
        return position

    def other_task(self, suite: str, index: int) -> TinyWorld:
        """Return another world of the only task, whatever is asked for."""
        if self._other is None:
            self._other = TinyWorld()
        return self._other

    def close(self) -> None:
        if self._other is not None:
            self._other.close()
        super().close()

    def _new_renderer(self) -> Renderer:
        from pytest_libero_max.worlds.rendering.renderer import Renderer

        return Renderer(self._model, self._data, samples=0)

    def _decided(self) -> Mapping[str, Any]:
        return {"goal": [["on", "box_1", "plate_1"]], "control": [STEP_M, _SUBSTEPS, _REACH_M, _HAND_START_M]}

    def succeeded(self) -> bool:
        box, plate = self.position("box_1"), self.position("plate_1")
        near = float(np.linalg.norm(box[:2] - plate[:2])) < 0.05
        return near and "plate_1" in self.contacts("box_1")


class TinySubstrate:
    """Plays every case in one :class:`TinyWorld`, whatever suite and task the case names."""

    name = "tiny"

    def __init__(self) -> None:
        self._world: TinyWorld | None = None

    def world(self, case: Case) -> TinyWorld:
        if self._world is not None and self._world.spoiled:
            self.close()
        if self._world is None:
            self._world = TinyWorld()
        return self._world

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        return {"substrate": self.name, **TinyWorld.versions(images)}

    def close(self) -> None:
        if self._world is not None:
            self._world.close()
            self._world = None
