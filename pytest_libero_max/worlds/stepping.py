"""One control step of robosuite's ``env.step`` with one physics pass per substep, and the same bits.

robosuite plays a control step of an arm under ``OSC_POSE`` as 25 substeps, each of them two
``mj_forward``, the operational space controller in Python, and a ``mj_step`` that starts with a
third forward pass. ``mj_forward`` is idempotent (MuJoCo 3.3.6 and newer), so the two extra passes
change nothing. What is left per substep is: torques from the current kinematics, ``mj_step2``, and
``mj_step1`` for the next one. All of it runs inside one compiled function that calls libmujoco by
address.

The last ``mj_step1`` brings derived data up to date with the end of the step, so the world is settled
after a step without another pass; in return it has to be settled before one.

Equal bits need equal operations in equal order on equally laid out arrays: Jacobians and the mass
matrix of the arm in Fortran order, as robosuite's fancy indexing leaves them; site velocities as the
product of the whole C-ordered (3, nv) Jacobian with qvel. Products, inverse and pseudo-inverses are the
very calls of BLAS and LAPACK that Numba makes of robosuite's functions, with the same flags and sizes,
but on memory that is reserved once: that takes less time, and a quarter of the time to compile.
"""

from __future__ import annotations

import copy
import ctypes
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import cgutils, types
from numba.core.cgutils import ir
from numba.extending import get_cython_function_address, intrinsic
from scipy.linalg import lapack

from pytest_libero_max.errors import SimulatorError, SubstrateError
from pytest_libero_max.worlds.compiling import compiled
from pytest_libero_max.worlds.contract import Array, Control
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.robot import ACTION_DIM, PANDA

gl.import_robosuite()

import mujoco  # noqa: E402
from robosuite.utils.transform_utils import EPS, axisangle2quat  # noqa: E402

_TASK_DIM = 6
"""Coordinates of the hand that the controller moves: three of place, three of rotation."""

_NULLSPACE_KP = 10
_NULLSPACE_KV = math.sqrt(_NULLSPACE_KP) * 2
"""Gains that hold the arm near its home pose where the hand leaves it free, as in ``nullspace_torques``."""

_SINGULAR = 1e-15
"""Singular values up to this share of the largest one count as zero, as in ``pinv``."""

_BROKEN = -1.0


class Stepper:
    """Plays control steps on the model and data of a robosuite environment with one arm.

    The environment's own objects are the source of gains, limits and indices; they are read once and
    never written. What the controller remembers between steps is here: the goal orientation, which an
    action without rotation keeps, and the gripper's integrated command.

    Attributes:
        constants: Constants of the control step, by name: gains, limits (N m), home pose (rad), grip.
        home: Joint positions (dofs,), rad, near which the arm is held where the hand leaves it free. A world
            whose controller takes those of each start writes them here.

    Args:
        env: A robosuite ``SingleArmEnv`` after its reset, with the controller ``OSC_POSE`` in fixed
            impedance mode and a gripper with two actuators and one action.

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
        self._speed, self._closing = float(gripper.speed), _closing_signs(gripper)
        self._site_pos = data.site_xpos[self._site]
        self._site_mat = data.site_xmat[self._site].reshape(3, 3)
        self._grip = np.zeros(2)
        self._goal_ori = np.zeros((3, 3))
        limits = {"low": np.array(low, dtype=np.float64), "high": np.array(high, dtype=np.float64)}
        gains = {
            "kp": np.array(controller.kp, dtype=np.float64),
            "kd": np.array(controller.kd, dtype=np.float64),
        }
        self.home = np.array(controller.initial_joint, dtype=np.float64)
        grip_middle, grip_half = 0.5 * (span[:, 1] + span[:, 0]), 0.5 * (span[:, 1] - span[:, 0])
        self.constants: Mapping[str, Any] = {
            "substeps": self.substeps,
            "scaling": self._scaling,
            **gains,
            **limits,
            "initial_joint": self.home.copy(),
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
        self._goal_pos = np.zeros(3)
        self._memory = _Memory(len(self.arm_dofs), model.nv)
        self._kept = (
            *self._memory.arrays,
            self._goal_pos,
            self._goal_ori,
            self._grip,
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
            self.home,
            *limits.values(),
            grip_middle,
            grip_half,
        )
        # Addresses, because Numba takes 1.5 microseconds for each array that it is given.
        places = (array.ctypes.data for array in self._kept)
        numbers = (len(self.arm_dofs), model.nv, model._address, data._address, self._site)
        self._fixed = np.array([*self._memory.addresses, *numbers, *places])
        self._warned = data.warning.number

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
        self._grip[:] = np.negative(self._closing)

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
            self._goal_ori[:] = _matrix(np.roll(axisangle2quat(action[3 : ACTION_DIM - 1]), 1))
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
        """Play a part of a control step; derived data must be up to date before, or raise SimulatorError.

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
        first, second = self._closing
        self._goal_pos[:] = goal_pos
        fastest: float = _control_step(
            self._fixed, first * push, second * push, substeps, settle, self._warned
        )
        if fastest == _BROKEN:
            raise SimulatorError(
                "The arm's controller cannot invert its matrices, which are no longer finite. The episode is "
                "lost; reset the world."
            )
        return fastest


class _Memory:
    """Memory that the controller's linear algebra works on, reserved once.

    Attributes:
        arrays: What the compiled code works on, in its order. Matrices are stored as Fortran does, column by
            column, except for what MuJoCo writes.
        addresses: Those of the functions of :func:`_addresses`, then of three tables for Fortran, which
            takes addresses only: whole numbers from 0 on, the letters of :data:`_LETTERS`, 1 and 0.
    """

    def __init__(self, dofs: int, nv: int) -> None:
        # A 64-bit number whose upper half is empty reads the same as 32 bits, which Fortran takes it for.
        numbers = np.arange(max(nv, dofs, _TASK_DIM) + 1)
        letters, scales = np.frombuffer(_LETTERS, dtype=np.uint8), np.array([1.0, 0.0])
        self._tables = (numbers, letters, scales)
        self.addresses = (*_addresses(), *(table.ctypes.data for table in self._tables))
        # As much as LAPACK asks for, since its way through a matrix depends on it.
        works = [int(lapack.dgetri_lwork(dofs)[0])]
        for size in (_TASK_DIM, 3):
            works.append(int(lapack.dgesdd_lwork(size, size, compute_uv=1, full_matrices=0)[0]))
        self.arrays = (
            np.zeros((3, nv)),  # Jacobians of the site
            np.zeros((3, nv)),
            np.zeros((dofs, _TASK_DIM)),  # those of the arm: of the hand, of its place, of its rotation
            np.zeros((dofs, 3)),
            np.zeros((dofs, 3)),
            np.zeros((dofs, dofs)),  # mass matrix of the arm, its inverse, what the hand leaves free
            np.zeros((dofs, dofs)),
            np.zeros((dofs, dofs)),
            np.zeros((_TASK_DIM, _TASK_DIM)),  # inertias that the hand feels
            np.zeros((3, 3)),
            np.zeros((3, 3)),
            np.zeros((2, dofs * dofs)),  # products on the way
            np.zeros(_TASK_DIM),  # singular values and vectors
            np.zeros((2, _TASK_DIM * _TASK_DIM)),
            np.zeros((5, max(dofs, _TASK_DIM))),  # vectors: two on the way, velocity, force, torques
            np.zeros(max(works)),
            np.array(works),
            np.zeros(8 * dofs, dtype=np.int64),  # pivots, or integers that LAPACK works on
            np.zeros(1, dtype=np.int64),  # what LAPACK says of its success
        )


def _rotation(vector: list[float]) -> Array:
    """Return the matrix of an axis times its angle: ``axisangle2quat`` and ``quat2mat`` of robosuite.

    The length is BLAS's, and sine and cosine are NumPy's, as there: other ones may differ in the last bit.
    """
    array = np.array(vector)
    angle = math.sqrt(np.dot(array, array))
    half = angle / 2.0
    sine = float(np.sin(half))
    matrix: Array = _matrix(np.array([np.cos(half), *(part / angle * sine for part in vector)]))
    return matrix


def _closing_signs(gripper: Any) -> tuple[float, float]:
    """Return the signs of the changes of both actuators' commands when the gripper closes."""
    probe = copy.copy(gripper)  # it keeps what it was asked for
    probe.current_action = np.zeros(gripper.dof)
    first, second = np.broadcast_to(np.sign(probe.format_action(np.ones(gripper.dof))), 2).tolist()
    return first, second


def _check(env: Any, robot: Any, controller: Any) -> None:
    wanted: dict[str, tuple[Any, Any]] = {
        "controller.name": (controller.name, PANDA.controller),
        "controller.impedance_mode": (controller.impedance_mode, "fixed"),
        "controller.use_delta": (controller.use_delta, True),
        "controller.uncoupling": (controller.uncoupling, True),
        "controller.interpolator_pos": (controller.interpolator_pos, None),
        "controller.interpolator_ori": (controller.interpolator_ori, None),
        "controller.position_limits": (controller.position_limits, None),
        "controller.orientation_limits": (controller.orientation_limits, None),
        "gripper.dof": (robot.gripper.dof, 1),
        "gripper.actuators": (len(robot.gripper.actuators), 2),
    }
    for what, (seen, rule) in wanted.items():
        if not np.array_equal(seen, rule):
            raise SubstrateError(f"{what}={seen!r}, but the lean control step reproduces {rule!r} only.")
    if env.sim.model.opt.integrator != mujoco.mjtIntegrator.mjINT_EULER:
        raise SubstrateError("The lean control step splits mj_step in two, which needs the Euler integrator.")


@cache
def _addresses() -> tuple[int, ...]:
    """Addresses of libmujoco's, BLAS's and LAPACK's functions in this process, in the order below."""
    library = next(Path(mujoco.__file__).parent.glob("libmujoco*"))
    loaded = ctypes.CDLL(str(library))
    names = ("mj_step1", "mj_step2", "mj_jacSite")
    addresses = [ctypes.cast(getattr(loaded, name), ctypes.c_void_p).value or 0 for name in names]
    # Those of SciPy, which Numba calls as well.
    addresses += [
        get_cython_function_address("scipy.linalg.cython_blas", name) for name in ("dgemm", "dgemv")
    ]
    lapack_names = ("dgetrf", "dgetri", "dgesdd")
    addresses += [get_cython_function_address("scipy.linalg.cython_lapack", name) for name in lapack_names]
    return tuple(addresses)


_STEP1, _STEP2, _JAC_SITE, _GEMM, _GEMV, _GETRF, _GETRI, _GESDD, _NUMBERS, _TABLE, _SCALES = range(11)
_INVERSE, _PRODUCTS, _VALUES, _VECTORS, _WORK, _WORKS, _INTEGERS = 22, 27, 28, 29, 31, 32, 33
"""Places among the numbers and addresses that :class:`Stepper` puts together for the compiled code."""

_LETTERS = b"NTCS"
_AS_IT_IS, _TRANSPOSED, _CONJUGATED, _SMALL = range(4)
"""Places in the letters: what BLAS does to a matrix first, and how many singular vectors LAPACK returns."""


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


@intrinsic  # type: ignore[untyped-decorator]
def _pointer(typing_context: Any, address: Any) -> Any:
    """Return a pointer to an address, given as an int64."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.int64), generate


@compiled
def _floats(address: Any, shape: Any) -> Any:
    """Return the float64 array at an address."""
    return numba.carray(_pointer(address), shape, np.float64)


@compiled
def _integers(address: Any, shape: Any) -> Any:
    """Return the int64 array at an address."""
    return numba.carray(_pointer(address), shape, np.int64)


@compiled
def _matrix(quaternion: Any) -> Any:
    """Return the matrix of a quaternion w, x, y, z as robosuite's ``quat2mat``, in single precision."""
    q = quaternion.astype(np.float32)
    length = np.dot(q, q)
    matrix = np.zeros((3, 3))
    if length < EPS:
        matrix[0, 0] = matrix[1, 1] = matrix[2, 2] = 1.0
        return matrix
    scale = math.sqrt(2.0 / length)
    for k in range(4):
        q[k] = q[k] * scale
    w, x, y, z = q[0], q[1], q[2], q[3]
    matrix[0, 0] = 1.0 - y * y - z * z
    matrix[0, 1] = x * y - z * w
    matrix[0, 2] = x * z + y * w
    matrix[1, 0] = x * y + z * w
    matrix[1, 1] = 1.0 - x * x - z * z
    matrix[1, 2] = y * z - x * w
    matrix[2, 0] = x * z - y * w
    matrix[2, 1] = y * z + x * w
    matrix[2, 2] = 1.0 - x * x - y * y
    return matrix


@compiled
def _product(fixed: Any, turns: Any, sizes: Any, a: Any, lda: Any, b: Any, ldb: Any, c: Any) -> None:
    """Write the (m, n) product of an (m, k) and a (k, n) matrix, each transposed before or not, to ``c``.

    Args:
        turns: What is done to each of both first.
        sizes: m, n and k.
        a, lda, b, ldb: Addresses and leading dimensions of both.
    """
    numbers, letters, one = fixed[_NUMBERS], fixed[_TABLE], fixed[_SCALES]
    m, n, k = numbers + 8 * sizes[0], numbers + 8 * sizes[1], numbers + 8 * sizes[2]
    turned = (letters + turns[0], letters + turns[1])
    _call(fixed[_GEMM], (*turned, m, n, k, one, a, numbers + 8 * lda, b, numbers + 8 * ldb, one + 8, c, m))


@compiled
def _applied(fixed: Any, turn: Any, m: Any, n: Any, a: Any, x: Any, y: Any) -> None:
    """Write the product of an (m, n) matrix, transposed before or not, with a vector to ``y``."""
    numbers, one = fixed[_NUMBERS], fixed[_SCALES]
    rows, columns, single = numbers + 8 * m, numbers + 8 * n, numbers + 8
    _call(fixed[_GEMV], (fixed[_TABLE] + turn, rows, columns, one, a, rows, x, single, one + 8, y, single))


@compiled
def _invert(fixed: Any, dofs: Any, info: Any) -> Any:
    """Invert the mass matrix in place, as ``inv`` does; return False where it is singular."""
    size, inverse, pivots = fixed[_NUMBERS] + 8 * dofs, fixed[_INVERSE], fixed[_INTEGERS]
    info[0] = 0
    _call(fixed[_GETRF], (size, size, inverse, size, pivots, info.ctypes.data))
    if info[0] != 0:
        return False
    _call(fixed[_GETRI], (size, inverse, size, pivots, fixed[_WORK], fixed[_WORKS], info.ctypes.data))
    return info[0] == 0


@compiled
def _feel(fixed: Any, dofs: Any, rows: Any, jacobian: Any, felt: Any, room: Any, info: Any) -> Any:
    """Write the inertia that some coordinates of the hand feel: the ``pinv`` of J M^-1 J^T, (rows, rows).

    Args:
        jacobian: Address of J.
        room: Address of the number of LAPACK's work space for this size.

    Returns:
        False where it is not finite.
    """
    products, values = _floats(fixed[_PRODUCTS], (2, dofs * dofs)), _floats(fixed[_VALUES], (6,))
    vectors = _floats(fixed[_VECTORS], (2, 36))
    between, whole = products[0].ctypes.data, products[1].ctypes.data
    left, right, out = vectors[0].ctypes.data, vectors[1].ctypes.data, felt.ctypes.data
    both = (_TRANSPOSED, _TRANSPOSED)
    _product(fixed, both, (dofs, rows, dofs), fixed[_INVERSE], dofs, jacobian, rows, between)
    _product(fixed, (_AS_IT_IS, _AS_IT_IS), (rows, rows, dofs), jacobian, rows, between, dofs, whole)
    for i in range(rows):
        for j in range(rows):
            value = products[1, i * rows + j]
            if not math.isfinite(value):
                return False
            felt[j, i] = value
    count, info[0] = fixed[_NUMBERS] + 8 * rows, 0
    matrices = (out, count, fixed[_VALUES], left, count, right, count)
    ends = (fixed[_WORK], room, fixed[_INTEGERS], info.ctypes.data)
    _call(fixed[_GESDD], (fixed[_TABLE] + _SMALL, count, count, *matrices, *ends))
    if info[0] != 0:
        return False
    least, last = values[0] * _SINGULAR, 0
    for k in range(rows):
        if values[k] > least:
            values[k] = 1.0 / values[k]
            last = k
    for i in range(rows):
        for j in range(last + 1):
            vectors[1, i * rows + j] = vectors[1, i * rows + j] * values[j]
    _product(fixed, (_CONJUGATED, _CONJUGATED), (rows, rows, last + 1), right, rows, left, rows, out)
    return True


@compiled
def _control_step(fixed: Any, first: Any, second: Any, substeps: Any, settle: Any, warned: Any) -> Any:
    """Play the substeps of a control step: torques, ``mj_step2``, ``mj_step1``; return what ``play`` does.

    Where the controller cannot go on, return :data:`_BROKEN`.

    Args:
        fixed: Numbers and addresses, as :class:`Stepper` puts them together. Of arrays whose size is not
            needed the shape is given as (1,).
        first, second: Changes of the gripper's commands in a substep.
        settle: True to bring derived data up to date at the end.
        warned: MuJoCo's counts of its warnings.
    """
    dofs, nv, model, data, site = fixed[11], fixed[12], fixed[13], fixed[14], fixed[15]
    jac_pos, jac_ori = _floats(fixed[16], (3, nv)), _floats(fixed[17], (3, nv))
    j_full, j_pos = _floats(fixed[18], (dofs, 6)), _floats(fixed[19], (dofs, 3))
    j_ori, mass = _floats(fixed[20], (dofs, 3)), _floats(fixed[21], (dofs, dofs))
    inverse, free = _floats(fixed[_INVERSE], (dofs, dofs)), _floats(fixed[23], (dofs, dofs))
    felt_full, felt_pos = _floats(fixed[24], (6, 6)), _floats(fixed[25], (3, 3))
    felt_ori, products = _floats(fixed[26], (3, 3)), _floats(fixed[_PRODUCTS], (2, dofs * dofs))
    lines, works, info = _floats(fixed[30], (5, max(dofs, 6))), fixed[_WORKS], _integers(fixed[34], (1,))
    goal_pos, goal_ori = _floats(fixed[35], (3,)), _floats(fixed[36], (3, 3))
    grip, qpos, qvel = _floats(fixed[37], (2,)), _floats(fixed[38], (1,)), _floats(fixed[39], (nv,))
    site_pos, site_mat = _floats(fixed[40], (3,)), _floats(fixed[41], (3, 3))
    qM, qfrc_bias, ctrl = _floats(fixed[42], (1,)), _floats(fixed[43], (nv,)), _floats(fixed[44], (1,))
    arm_qpos, arm_dofs = _integers(fixed[45], (dofs,)), _integers(fixed[46], (dofs,))
    arm_ctrl, finger_ctrl = _integers(fixed[47], (dofs,)), _integers(fixed[48], (2,))
    mass_at, initial_joint = _integers(fixed[49], (dofs, dofs)), _floats(fixed[52], (dofs,))
    kp, kd = _floats(fixed[50], (6,)), _floats(fixed[51], (6,))
    low, high = _floats(fixed[53], (dofs,)), _floats(fixed[54], (dofs,))
    grip_middle, grip_half = _floats(fixed[55], (2,)), _floats(fixed[56], (2,))
    vector, velocity, arm = lines[0], lines[2], lines[4]
    given, taken = vector.ctypes.data, lines[1].ctypes.data
    moving, force, torques = velocity.ctypes.data, lines[3].ctypes.data, arm.ctypes.data
    between, whole = products[0].ctypes.data, products[1].ctypes.data
    hand, place, turn = j_full.ctypes.data, j_pos.ctypes.data, j_ori.ctypes.data
    inverted, speeds = inverse.ctypes.data, qvel.ctypes.data
    for substep in range(substeps):
        _call(fixed[_JAC_SITE], (model, data, jac_pos.ctypes.data, jac_ori.ctypes.data, site))
        for k in range(dofs):
            for axis in range(3):
                j_pos[k, axis] = j_full[k, axis] = jac_pos[axis, arm_dofs[k]]
                j_ori[k, axis] = j_full[k, axis + 3] = jac_ori[axis, arm_dofs[k]]
            for other in range(dofs):
                at = mass_at[k, other]
                mass[k, other] = inverse[k, other] = qM[at] if at >= 0 else 0.0
                if not math.isfinite(mass[k, other]):
                    return _BROKEN
        _applied(fixed, _TRANSPOSED, nv, 3, jac_pos.ctypes.data, speeds, moving)
        _applied(fixed, _TRANSPOSED, nv, 3, jac_ori.ctypes.data, speeds, moving + 24)
        if not (
            _invert(fixed, dofs, info)
            and _feel(fixed, dofs, 6, hand, felt_full, works + 8, info)
            and _feel(fixed, dofs, 3, place, felt_pos, works + 16, info)
            and _feel(fixed, dofs, 3, turn, felt_ori, works + 16, info)
        ):
            return _BROKEN
        # The torques that pull the hand towards its goal.
        for axis in range(3):
            vector[axis] = (goal_pos[axis] - site_pos[axis]) * kp[axis] + (-velocity[axis]) * kd[axis]
        _applied(fixed, _AS_IT_IS, 3, 3, felt_pos.ctypes.data, given, force)
        for axis in range(3):
            one, two = (axis + 1) % 3, (axis + 2) % 3
            error = 0.0
            for column in range(3):
                part = (
                    site_mat[one, column] * goal_ori[two, column]
                    - site_mat[two, column] * goal_ori[one, column]
                )
                error = part if column == 0 else error + part
            error = 0.5 * error
            vector[axis] = error * kp[axis + 3] + (-velocity[axis + 3]) * kd[axis + 3]
        _applied(fixed, _AS_IT_IS, 3, 3, felt_ori.ctypes.data, given, force + 24)
        _applied(fixed, _TRANSPOSED, 6, dofs, hand, force, torques)
        # Those that hold the arm near its home pose, as far as the hand leaves it free.
        back = (_TRANSPOSED, _AS_IT_IS)
        _product(fixed, (_AS_IT_IS, _TRANSPOSED), (6, dofs, dofs), hand, 6, inverted, dofs, between)
        _product(fixed, back, (6, dofs, 6), felt_full.ctypes.data, 6, between, 6, whole)
        _product(fixed, back, (dofs, dofs, 6), hand, 6, whole, 6, between)
        for k in range(dofs):
            for other in range(dofs):
                free[k, other] = (1.0 if k == other else 0.0) - products[0, k * dofs + other]
            away = initial_joint[k] - qpos[arm_qpos[k]]
            vector[k] = _NULLSPACE_KP * away - _NULLSPACE_KV * qvel[arm_dofs[k]]
        _applied(fixed, _AS_IT_IS, dofs, dofs, mass.ctypes.data, given, taken)
        _applied(fixed, _AS_IT_IS, dofs, dofs, free.ctypes.data, taken, given)
        for k in range(dofs):
            value = (arm[k] + qfrc_bias[arm_dofs[k]]) + vector[k]
            ctrl[arm_ctrl[k]] = min(max(value, low[k]), high[k])
        grip[0] = min(max(grip[0] + first, -1.0), 1.0)
        grip[1] = min(max(grip[1] + second, -1.0), 1.0)
        for finger in range(2):
            ctrl[finger_ctrl[finger]] = grip_middle[finger] + grip_half[finger] * grip[finger]
        _call(fixed[_STEP2], (model, data))
        if settle or substep + 1 < substeps:
            _call(fixed[_STEP1], (model, data))
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
