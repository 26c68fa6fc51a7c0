"""The page of the worlds: protocol constants, observations, actions, and the contract of a world."""

from __future__ import annotations

import inspect

from pytest_libero_max import worlds
from pytest_libero_max.benchmark import cases
from pytest_libero_max.tasks.suites import LIBERO
from pytest_libero_max.worlds import contract, robot, scenery
from tests.reference.docstrings import constants, description, section, summary
from tests.reference.markdown import code, one_line, prose, table

OBSERVATIONS = {
    "agentview_image": ("(size, size, 3)", "uint8", "Red, green, blue. Row 0 is the bottom of the picture."),
    "robot0_eye_in_hand_image": ("(size, size, 3)", "uint8", "The same, of the camera at the wrist."),
    "robot0_eef_pos": ("(3,)", "float64", "Position of the grip site between the fingers, m, world frame."),
    "robot0_eef_quat": ("(4,)", "float64", "Orientation of the hand, quaternion xyzw, world frame."),
    "robot0_gripper_qpos": ("(2,)", "float64", "Positions of the two fingers, m."),
    "robot0_gripper_qvel": ("(2,)", "float64", "Velocities of the two fingers, m/s."),
    "robot0_joint_pos": ("(7,)", "float64", "Angles of the arm's joints, rad."),
    "robot0_joint_vel": ("(7,)", "float64", "Velocities of the arm's joints, rad/s."),
}
"""Shape, type and meaning of every key of an observation; a test compares them with what a world returns."""

ACTIONS = (
    ("0 to 2", "Translation of the hand's goal along x, y, z of the world; 1 is 5 cm."),
    ("3 to 5", "Rotation of the hand's goal, an axis-angle vector in the world frame; length 1 is 0.5 rad."),
    ("6", "Gripper: above 0 closes it, below 0 opens it."),
)
"""The components of an action of LIBERO's controller, OSC_POSE, for one control step."""

POSES = (
    ("0 to 2", "Position of the grip site, m, world frame; the site is `robot0_eef_pos`."),
    (
        "3 to 5",
        "Orientation of the grip site, axis times angle in rad, world frame. `grip_site_quaternion` of "
        "`transforms.states` makes it of `robot0_eef_quat`, that of the hand, a quarter turn about z away.",
    ),
    ("6", "Gripper: above 0 closes it, below 0 opens it."),
)
"""The components of an action under absolute control."""

SEMANTICS = (
    (
        "Reset",
        "The scene is built once (`hard_reset = False`).",
        "Built twice, as LIBERO does by default: where a task begins with something opened, closed or turned "
        "on, fixtures stand up to 12 mm and 1.9 degrees elsewhere.",
    ),
    (
        "Observations",
        "Sampled at substep 21 of 25, at 20 after an event; each look of a LIBERO-PRO variation makes it one "
        "less.",
        "Sampled at substep 24, as after LIBERO's own `set_init_state`.",
    ),
    (
        "Objects brought in",
        "Wait inside the floor, are shot out of it, and come back as they have tumbled by then.",
        "Wait unseen and untouched, and come back upright.",
    ),
    ("Objects moved", "Keep their share of the solver's last forces.", "Start without."),
    ("Noise of sensors", "One stream for both cameras.", "One stream for each camera."),
)
"""Meaning of each value of ``--libero-max-substrate=libero:semantics=WHICH`` on the genuine substrate."""


def page() -> str:
    """The text."""
    observations = table(
        ("Key", "Shape", "Type", "Meaning"), ((code(key), *entry) for key, entry in OBSERVATIONS.items())
    )
    budgets = table(("Suite", "Policy steps"), ((suite.name, str(suite.budget)) for suite in LIBERO))
    numbers = table(
        ("Constant", "Value", "Meaning"),
        (
            (code(item.name), code(item.value), one_line(item.text))
            for module in (cases, robot)
            for item in constants(module)
            if item.value.isdigit() or item.value.startswith("(")
        ),
    )
    return f"""# Worlds

{prose(description(worlds))}

## Observations

A policy gets a dictionary with LIBERO's own keys. It holds an image for each camera that the policy's spec
names, of the size that the spec names. `image[::-1]` is the right way up.

{observations}

## Actions

A policy returns an array (n, 7) with components within [-1, 1]; what lies beyond is clipped.

{table(("Component", "Meaning"), ACTIONS)}

A policy that declares `control="absolute"` returns poses instead, as LIBERO's controller takes them with
`use_delta = False`. The settle steps before its first action are movements. Poses are not clipped; a position
farther than {contract.FARTHEST_M:g} m from the world's origin, or a rotation by more than a whole turn, is an
error of the adapter.

{table(("Component", "Meaning"), POSES)}

## Published and corrected

`--libero-max-substrate=libero:semantics=WHICH` chooses what a genuine scene reproduces: `published`, the
authors' runner of 8 August 2026, with the same states, observations and images bit for bit on the same
MuJoCo; or `corrected`, without its known errors.

{table(("", "Published", "Corrected"), SEMANTICS)}

## Budgets

Policy steps an episode of a suite of LIBERO may take after the settle steps.

{budgets}

## Protocol constants

{numbers}

## The contract of a world

{_protocol(contract.World)}

{_protocol(contract.PosedWorld)}

## Robots

{_fields(robot.Robot)}

## What changes use

{_protocol(contract.AlterableWorld)}

{_fields(scenery.CameraView)}

{_fields(scenery.Lights)}

{_fields(scenery.Surfaces)}

## Worlds on MuJoCo

{_protocol(contract.OnMujoco)}
"""


def _protocol(protocol: type) -> str:
    """Description and table of the members that a protocol adds."""
    members = ((name, value) for name, value in vars(protocol).items() if not name.startswith("_"))
    rows = ((code(name + _arguments(value)), one_line(summary(value))) for name, value in members)
    return f"{prose(description(protocol))}\n\n{table(('Member', 'Meaning'), rows)}"


def _fields(kind: type) -> str:
    """Description and table of the fields of a value."""
    rows = ((code(name), one_line(text)) for name, text in section(kind, "Attributes").items())
    return f"{prose(description(kind))}\n\n{table(('Field', 'Meaning'), rows)}"


def _arguments(value: object) -> str:
    if not inspect.isfunction(value):
        return ""
    names = [name for name in inspect.signature(value).parameters if name != "self"]
    return f"({', '.join(names)})"
