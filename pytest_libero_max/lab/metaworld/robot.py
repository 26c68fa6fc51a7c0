"""Meta-World's Sawyer, the suite of its fifty tasks, and the package that has to be installed apart."""

from __future__ import annotations

from importlib.util import find_spec
from types import MappingProxyType

from pytest_libero_max.benchmark.suites import Suite
from pytest_libero_max.worlds.robot import GRIPPER, ROBOT, MujocoRobot

PACKAGES = ("metaworld", "gymnasium", "imageio")
INSTALL = f"pip install --no-deps {' '.join(PACKAGES)}"


def lacking_packages() -> str:
    """Return the packages that are missing with the command that installs them; empty for none."""
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if not missing:
        return ""
    return f"the package {' and '.join(missing)} is not installed: {INSTALL} (it pins another MuJoCo)"


MT50 = Suite("metaworld_mt50", 500, "metaworld", "mt50", tasks=50, states=50)
"""Meta-World's own number of steps; its initial states are drawn from the seeds 0 to 49."""


MAIN_CAMERA, HAND_CAMERA = "corner2", "gripperPOV"

_ARM = (
    *("base", "controller_box", "pedestal_feet", "torso", "pedestal", "right_arm_base_link"),
    *("head", "screen", "head_camera", "right_*"),
)
_GRIPPER = ("hand", "rightclaw", "leftclaw", "rightpad", "leftpad")

SAWYER = MujocoRobot(
    name="SawyerXYZ",
    noop=(0.0, 0.0, 0.0, -1.0),
    control_hz=80,
    cameras=(MAIN_CAMERA, HAND_CAMERA),
    state=MappingProxyType({"agent_pos": 4, "hand_quat": 4, "joint_pos": 7, "joint_vel": 7, "finger_pos": 2}),
    joints_key="joint_pos",
    fingers_key="finger_pos",
    arm_joints=tuple(f"right_j{number}" for number in range(7)),
    finger_joints=("r_close", "l_close"),
    hand_body="hand",
    grip_site="endEffector",
    base_body="base",
    reach_m=1.1,
    controller="mocap",
    owners=MappingProxyType({**dict.fromkeys(_ARM, ROBOT), **dict.fromkeys(_GRIPPER, GRIPPER)}),
)
"""The arm follows a mocap body that an action moves by up to 1 cm; the hand keeps its orientation.
``agent_pos`` is the position of the hand (3, m) and the opening of the fingers (0 to 1): the state that the
field's policies read."""
