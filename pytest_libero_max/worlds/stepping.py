"""One control step of robosuite's ``env.step`` with one physics pass per substep, and the same bits.

robosuite plays a control step of a Panda under ``OSC_POSE`` as 25 substeps, each of them two
``mj_forward``, the operational space controller in Python, and a ``mj_step`` that starts with a
third forward pass. ``mj_forward`` is idempotent (MuJoCo 3.3.6 and newer), so the two extra passes
change nothing. What is left per substep is: torques from the current kinematics, ``mj_step2``, and
``mj_step1`` for the next one. All of it runs inside one compiled function that calls libmujoco by
address.

The last ``mj_step1`` brings derived data up to date with the end of the step, so the world is settled
after a step without another pass; in return it has to be settled before one.

Equal bits need equal operations in equal order on equally laid out arrays: Jacobians and the mass
matrix of the arm in Fortran order, as robosuite's fancy indexing leaves them; site velocities as the
product of the whole C-ordered (3, nv) Jacobian with qvel.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numba.core import cgutils, types
from numba.core.cgutils import ir
from numba.extending import intrinsic

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.compiling import compiled
from pytest_libero_max.worlds.contract import ACTION_DIM, Array, Control
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.robot import PANDA

gl.import_robosuite()

import mujoco  # noqa: E402
from robosuite.utils.control_utils import (  # noqa: E402
    nullspace_torques,
    opspace_matrices,
    orientation_error,
)
from robosuite.utils.transform_utils import axisangle2quat, quat2mat  # noqa: E402


class Stepper:
    """Plays control steps on the model and data of a robosuite environment with one Panda.

    The environment's own objects are the source of gains, limits and indices; they are read once and
    never written. What the controller remembers between steps is here: the goal orientation, which an
    action without rotation keeps, and the gripper's integrated command.

    Attributes:
        constants: Constants of the control step, by name: gains, limits (N m), home pose (rad), grip.

    Args:
        env: A robosuite ``SingleArmEnv`` after its reset, with the controller ``OSC_POSE`` in fixed
            impedance mode and a two-finger gripper with one action.

    Raises:
        SubstrateError: The robot or its controller is not of that kind.
    """

    def __init__(self, env: Any) -> None:
        robot = env.robots[0]
        controller, gripper = robot.controller, robot.gripper
        _check(env, robot, controller)
        self._model: mujoco.MjModel = env.sim.model._model
        self._data: mujoco.MjData = env.sim.data._data
        model, data = self._model, self._data
        controller.scale_action(np.zeros(ACTION_DIM - 1))  # it computes its factors the first time
        parts = (
            controller.input_min,
            controller.input_max,
            controller.action_input_transform,
            controller.action_scale,
            controller.action_output_transform,
        )
        self._scaling = tuple(
            zip(*(np.broadcast_to(part, ACTION_DIM - 1).tolist() for part in parts), strict=True)
        )
        self.substeps = int(env.control_timestep / env.model_timestep)
        self._site = int(robot.eef_site_id)
        self.arm_qpos = np.array(robot._ref_joint_pos_indexes, dtype=np.int64)
        self.arm_dofs = np.array(robot._ref_joint_vel_indexes, dtype=np.int64)
        self.finger_qpos = np.array(robot._ref_gripper_joint_pos_indexes, dtype=np.int64)
        self.finger_dofs = np.array(robot._ref_gripper_joint_vel_indexes, dtype=np.int64)
        arm_ctrl = np.array(robot._ref_joint_actuator_indexes, dtype=np.int64)
        finger_ctrl = np.array(robot._ref_joint_gripper_actuator_indexes, dtype=np.int64)
        low, high = robot.torque_limits
        span = model.actuator_ctrlrange[finger_ctrl]
        self._speed = float(gripper.speed)
        self._site_pos = data.site_xpos[self._site]
        self._site_mat = data.site_xmat[self._site].reshape(3, 3)
        self._grip = np.zeros(2)
        self._goal_ori = np.zeros((3, 3))
        limits = {"low": np.array(low, dtype=np.float64), "high": np.array(high, dtype=np.float64)}
        gains = {
            "kp": np.array(controller.kp, dtype=np.float64),
            "kd": np.array(controller.kd, dtype=np.float64),
        }
        home = np.array(controller.initial_joint, dtype=np.float64)
        grip_middle, grip_half = 0.5 * (span[:, 1] + span[:, 0]), 0.5 * (span[:, 1] - span[:, 0])
        self.constants: Mapping[str, Any] = {
            "substeps": self.substeps,
            "scaling": self._scaling,
            **gains,
            **limits,
            "initial_joint": home,
            "grip_speed": self._speed,
            "grip_middle": grip_middle,
            "grip_half": grip_half,
            "site": self._site,
            "arm_qpos": self.arm_qpos,
            "arm_dofs": self.arm_dofs,
            "arm_ctrl": arm_ctrl,
            "finger_qpos": self.finger_qpos,
            "finger_dofs": self.finger_dofs,
            "finger_ctrl": finger_ctrl,
        }
        self._fixed = (
            _addresses(),
            model._address,
            data._address,
            self._site,
            data.qpos,
            data.qvel,
            self._site_pos,
            self._site_mat,
            data.qM,
            data.qfrc_bias,
            data.ctrl,
            self.arm_qpos,
            self.arm_dofs,
            arm_ctrl,
            finger_ctrl,
            _mass_addresses(model, self.arm_dofs),
            *gains.values(),
            home,
            *limits.values(),
            grip_middle,
            grip_half,
            np.zeros((3, model.nv)),
            np.zeros((3, model.nv)),
            data.warning.number,
        )

    def start(self) -> None:
        """Forget the last episode: hold the present orientation, fingers half open.

        Derived data must be up to date.
        """
        self._goal_ori[:] = self._site_mat
        self._grip[:] = 0.0

    def state(self) -> Array:
        """(11,): goal orientation, row by row, and the gripper's two commands."""
        return np.concatenate([self._goal_ori.ravel(), self._grip])

    def restore(self, state: Array) -> None:
        """Write back what :meth:`state` returned."""
        self._goal_ori[:] = state[:9].reshape(3, 3)
        self._grip[:] = state[9:]

    def open_grip(self) -> None:
        """Set the gripper's commands to open; actions that close it bring them back step by step."""
        self._grip[:] = 1.0, -1.0

    def step(self, action: Array, control: Control = "delta") -> float:
        """Play one control step of a (7,) float64 action; derived data are up to date before and after.

        Returns:
            The largest speed of a joint, m/s or rad/s; infinite where MuJoCo has counted a warning.
        """
        return self.play(self.aim(action, control), action, self.substeps)

    def aim(self, action: Array, control: Control = "delta") -> Array:
        """Set the goal of a movement from the present kinematics; return the goal position, (3,) m, world.

        A substrate that has to reproduce an environment whose controller starts from kinematics of
        another pose, as LIBERO's does after ``set_init_state``, plays that substep with robosuite's own
        controller and the remaining ones with :meth:`play`.
        """
        if control == "absolute":
            self._goal_ori[:] = quat2mat(axisangle2quat(action[3 : ACTION_DIM - 1]))
            return action[:3].copy()
        delta = self._scaled(action)
        if any(delta[3:]):
            np.dot(_rotation(delta[3:]), self._site_mat, out=self._goal_ori)
        return np.array([place + part for place, part in zip(self._site_pos.tolist(), delta, strict=False)])

    def _scaled(self, action: Array) -> list[float]:
        """Return the movement that an action asks for, m and rad, as ``Controller.scale_action`` computes it.

        In Python's numbers, one by one: between two passes of physics the processor has forgotten the code
        of NumPy's functions, and they take ten times as long as when they are called in a row.
        """
        return [
            (min(max(part, low), high) - middle) * scale + offset
            for part, (low, high, middle, scale, offset) in zip(action.tolist(), self._scaling, strict=False)
        ]

    def play(self, goal_pos: Array, action: Array, substeps: int, settle: bool = True) -> float:
        """Play a part of a control step; derived data must be up to date before.

        Args:
            goal_pos: (3,) m, world, from :meth:`aim`.
            action: (7,); only its gripper command is used.
            substeps: Number of substeps, at least 1.
            settle: True to bring derived data up to date at the end. If not, they belong to the
                beginning of the last substep, as they do after robosuite's own step.

        Returns:
            The largest speed of a joint, m/s or rad/s; infinite where MuJoCo has counted a warning.
        """
        closing = float(action[ACTION_DIM - 1])
        push = self._speed * ((closing > 0.0) - (closing < 0.0))
        fastest: float = _control_step(
            goal_pos, self._goal_ori, self._grip, push, substeps, settle, *self._fixed
        )
        return fastest


def _rotation(vector: list[float]) -> Array:
    """Return the matrix of an axis times its angle: ``axisangle2quat`` and ``quat2mat`` of robosuite.

    The length is BLAS's, and sine and cosine are NumPy's, as there: other ones may differ in the last bit.
    """
    array = np.array(vector)
    angle = math.sqrt(np.dot(array, array))
    half = angle / 2.0
    sine = float(np.sin(half))
    matrix: Array = quat2mat(np.array([*(part / angle * sine for part in vector), np.cos(half)]))
    return matrix


def _check(env: Any, robot: Any, controller: Any) -> None:
    wanted: dict[str, tuple[Any, Any]] = {
        "robot.dof": (len(robot._ref_joint_pos_indexes), len(PANDA.arm_joints)),
        "controller.name": (controller.name, PANDA.controller),
        "controller.impedance_mode": (controller.impedance_mode, "fixed"),
        "controller.use_delta": (controller.use_delta, True),
        "controller.uncoupling": (controller.uncoupling, True),
        "controller.interpolator_pos": (controller.interpolator_pos, None),
        "controller.interpolator_ori": (controller.interpolator_ori, None),
        "controller.position_limits": (controller.position_limits, None),
        "controller.orientation_limits": (controller.orientation_limits, None),
        "gripper.dof": (robot.gripper.dof, 1),
    }
    for what, (seen, rule) in wanted.items():
        if not np.array_equal(seen, rule):
            raise SubstrateError(f"{what}={seen!r}, but the lean control step reproduces {rule!r} only.")
    if env.sim.model.opt.integrator != mujoco.mjtIntegrator.mjINT_EULER:
        raise SubstrateError("The lean control step splits mj_step in two, which needs the Euler integrator.")


@cache
def _addresses() -> np.ndarray[Any, np.dtype[np.int64]]:
    """Addresses of libmujoco's functions in this process, in the order that the compiled code wants."""
    library = next(Path(mujoco.__file__).parent.glob("libmujoco*"))
    loaded = ctypes.CDLL(str(library))
    names = ("mj_step1", "mj_step2", "mj_jacSite")
    found = [ctypes.cast(getattr(loaded, name), ctypes.c_void_p).value for name in names]
    return np.array(found, dtype=np.int64)


def _mass_addresses(model: mujoco.MjModel, dofs: Any) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return the places in the sparse ``qM`` of the arm's mass matrix, (7, 7); -1 where that is zero."""
    places = np.full((len(dofs), len(dofs)), -1, dtype=np.int64)
    rows = {int(dof): row for row, dof in enumerate(dofs)}
    for dof, row in rows.items():
        address, ancestor = int(model.dof_Madr[dof]), dof
        while ancestor >= 0:
            if ancestor in rows:
                places[row, rows[ancestor]] = places[rows[ancestor], row] = address
            address, ancestor = address + 1, int(model.dof_parentid[ancestor])
    return places


@intrinsic  # type: ignore[untyped-decorator]
def _call(typing_context: Any, address: Any, arguments: Any) -> Any:
    """Call the C function at ``address`` with integers or pointers, given as a tuple of int64."""
    signature = types.void(address, arguments)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        word = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [word] * len(signature.args[1]))
        pointer = builder.inttoptr(values[0], function.as_pointer())
        builder.call(pointer, cgutils.unpack_tuple(builder, values[1]))
        return context.get_dummy_value()

    return signature, generate


@compiled
def _control_step(
    goal_pos: Any,
    goal_ori: Any,
    grip: Any,
    push: Any,
    substeps: Any,
    settle: Any,
    functions: Any,
    model: Any,
    data: Any,
    site: Any,
    qpos: Any,
    qvel: Any,
    site_pos: Any,
    site_mat: Any,
    qM: Any,
    qfrc_bias: Any,
    ctrl: Any,
    arm_qpos: Any,
    arm_dofs: Any,
    arm_ctrl: Any,
    finger_ctrl: Any,
    mass_at: Any,
    kp: Any,
    kd: Any,
    initial_joint: Any,
    low: Any,
    high: Any,
    grip_middle: Any,
    grip_half: Any,
    jac_pos: Any,
    jac_ori: Any,
    warned: Any,
) -> Any:
    """Play the substeps of a control step: torques, ``mj_step2``, ``mj_step1``; return what ``play`` does."""
    dofs = arm_dofs.size
    mass = np.zeros((dofs, dofs)).T
    j_full = np.empty((dofs, 6)).T
    j_pos = np.empty((dofs, 3)).T
    j_ori = np.empty((dofs, 3)).T
    joint_pos = np.empty(dofs)
    joint_vel = np.empty(dofs)
    wrench = np.empty(6)
    for substep in range(substeps):
        _call(functions[2], (model, data, jac_pos.ctypes.data, jac_ori.ctypes.data, site))
        for k in range(dofs):
            joint_pos[k] = qpos[arm_qpos[k]]
            joint_vel[k] = qvel[arm_dofs[k]]
            for axis in range(3):
                j_pos[axis, k] = j_full[axis, k] = jac_pos[axis, arm_dofs[k]]
                j_ori[axis, k] = j_full[axis + 3, k] = jac_ori[axis, arm_dofs[k]]
            for other in range(dofs):
                place = mass_at[k, other]
                mass[k, other] = qM[place] if place >= 0 else 0.0
        vel_pos = np.dot(jac_pos, qvel)
        vel_ori = np.dot(jac_ori, qvel)
        ori_error = orientation_error(goal_ori, site_mat)
        force = (goal_pos - site_pos) * kp[0:3] + (-vel_pos) * kd[0:3]
        torque = ori_error * kp[3:6] + (-vel_ori) * kd[3:6]
        _, lambda_pos, lambda_ori, nullspace = opspace_matrices(mass, j_full, j_pos, j_ori)
        wrench[:3] = np.dot(lambda_pos, force)
        wrench[3:] = np.dot(lambda_ori, torque)
        arm = np.dot(j_full.T, wrench)
        rest = nullspace_torques(mass, nullspace, initial_joint, joint_pos, joint_vel)
        for k in range(dofs):
            value = (arm[k] + qfrc_bias[arm_dofs[k]]) + rest[k]
            ctrl[arm_ctrl[k]] = min(max(value, low[k]), high[k])
        grip[0] = min(max(grip[0] - push, -1.0), 1.0)
        grip[1] = min(max(grip[1] + push, -1.0), 1.0)
        for finger in range(2):
            ctrl[finger_ctrl[finger]] = grip_middle[finger] + grip_half[finger] * grip[finger]
        _call(functions[1], (model, data))
        if settle or substep + 1 < substeps:
            _call(functions[0], (model, data))
    fastest = 0.0
    for count in warned:
        if count:
            return np.inf
    for speed in qvel:
        if not abs(speed) <= fastest:
            fastest = abs(speed)
            if math.isnan(fastest):
                return fastest
    return fastest
