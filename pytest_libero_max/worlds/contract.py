"""The contract of a world: one scene that can be reset, stepped, rendered, copied and compared.

Everything above this room knows worlds through one of three protocols, each with a reader of its own.
:class:`World` is what the pair runner, triggers and policies ask of any simulator. :class:`AlterableWorld` is
what changes read and write: views, lights, surfaces, poses. A privileged policy may ask for more
(:class:`.privileged.PrivilegedWorld`). None of them needs MuJoCo; what reads MuJoCo's own arrays asks for
:class:`OnMujoco`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.robot import CAMERAS, Robot

if TYPE_CHECKING:
    import mujoco

    from pytest_libero_max.worlds.scenery import CameraView, Lights, Surfaces

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
ImageSize = int | tuple[int, int]
"""Side of a square image, or height and width, pixels."""
Observation = Mapping[str, NDArray[Any]]
"""LIBERO's own keys: ``agentview_image``, ``robot0_eye_in_hand_image`` ((H, W, 3) uint8, OpenGL row
order, so ``image[::-1]`` is upright), ``robot0_eef_pos`` (3, m, world), ``robot0_eef_quat`` (4, xyzw),
``robot0_gripper_qpos`` (2, m), ``robot0_gripper_qvel`` (2), ``robot0_joint_pos`` (7, rad) and
``robot0_joint_vel`` (7, rad/s)."""

EntityKind = Literal["object", "fixture", "surface"]

Semantics = Literal["published", "corrected"]

Control = Literal["delta", "absolute"]
"""Meaning of the components of an action before the last, which is the gripper. ``delta``, LIBERO's default:
a movement relative to where the hand is, in units of the controller. ``absolute``: a pose of the grip site in
the world, position in m and, where the robot's actions turn the hand, axis times angle in rad."""

FARTHEST_M = 3.0
"""Largest distance of an absolute action's position from the world's origin, m; out of the arm's reach."""

Goal = tuple[tuple[str, ...], ...]
"""Predicates that must all hold, as BDDL writes them: ``(("on", "akita_black_bowl_1", "plate_1"),)``."""


def height_and_width(size: ImageSize) -> tuple[int, int]:
    """Height and width of an image, pixels."""
    return (size, size) if isinstance(size, int) else size


@dataclass(frozen=True)
class Entity:
    """Something a case can name."""

    name: str
    """Instance name as in the task's BDDL, for example ``akita_black_bowl_1``."""
    category: str
    """LIBERO category, for example ``akita_black_bowl``."""
    kind: EntityKind
    """``object`` has a free joint, ``fixture`` is bolted to the scene (its drawers and knobs may move),
    ``surface`` is the table or the floor."""
    body: str
    """Name of its root body in the MuJoCo model; in another simulator whatever names it there."""
    support: str | None = None
    """The entity it is declared to rest on at reset, or None."""


class PixelFilter(Protocol):
    """A change of a camera's images: a pure, hashable, frozen function of its arguments.

    One with a true attribute ``hides_state`` also lets the world show a robot state of zeros, its orientation
    the identity.
    """

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        """Return the altered image.

        Args:
            image: (H, W, 3) uint8. Must not be written to.
            camera: Camera name, for example ``agentview``.
            step: Control steps since the filter was added; 0 for an image right after that.
        """


@dataclass(frozen=True)
class WorldState:
    """Everything the future of a world depends on, as a value that never aliases the live world."""

    scene: str
    """The scene it was taken from; restoring into another scene is refused."""
    physics: Array
    """The state that the simulator integrates, float64; MuJoCo's integration state."""
    model: Mapping[str, NDArray[Any]]
    """The alterable fields of the scene by name."""
    controller: Array
    """Controller and gripper state that the simulator does not hold, float64."""
    steps: int
    filters: tuple[tuple[PixelFilter, int], ...]
    """Active pixel filters with the step at which each was added."""
    parked: tuple[tuple[str, tuple[float, ...]], ...]
    """Names of the entities taken out of the scene with the pose (7, m and wxyz) each had then."""
    assigned: tuple[str | None, Goal | None] = (None, None)
    """Instruction and goal that were given in place of the task's own, None where they were not."""
    control: Control = "delta"
    """Meaning of the actions."""

    def differing(self, other: WorldState) -> tuple[str, ...]:
        """Return the names of everything that differs from another state; model fields by their own names."""
        nothing, names = np.empty(0), dict.fromkeys((*self.model, *other.model))
        fields = [
            name
            for name in names
            if self.model.get(name, nothing).tobytes() != other.model.get(name, nothing).tobytes()
        ]
        arrays = [name for name in ("physics", "controller") if _bytes(self, name) != _bytes(other, name)]
        plain = ("scene", "steps", "filters", "parked", "assigned", "control")
        values = [name for name in plain if getattr(self, name) != getattr(other, name)]
        return (*arrays, *fields, *values)


def _bytes(state: WorldState, name: str) -> bytes:
    array: Array = getattr(state, name)
    return array.tobytes()


@runtime_checkable
class World(Protocol):
    """One scene, built once and reused for every case that shares it.

    Between calls the world is always *settled in its own state*: positions, contacts and camera frames
    belong to the current joint positions. Rendering happens inside :meth:`observe` and nowhere else.
    """

    @property
    def scene(self) -> str:
        """Stable key, for example ``embedded/libero_spatial/0``."""

    @property
    def language(self) -> str:
        """The task's instruction as the benchmark gives it to a policy."""

    @property
    def robot(self) -> Robot:
        """The robot: its actions, its control rate, its cameras and the keys of its state."""

    @property
    def entities(self) -> Mapping[str, Entity]:
        """Everything that a case can name, by name."""

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras of the scene."""

    @property
    def parked(self) -> tuple[str, ...]:
        """Entities currently taken out of the scene, in the order in which they were parked."""

    def reset(self, init: int) -> None:
        """Start over from initial state ``init``; every trace of an earlier episode is gone.

        Raises:
            SubstrateError: The scene has no such initial state.
        """

    def step(self, action: Sequence[float] | Array) -> None:
        """Play one control step of an action of the robot; the controller clips movements beyond +-1.

        Raises:
            ActionError: Wrong shape or a component that is not finite.
            SimulatorError: The state is no longer finite.
        """

    def set_control(self, control: Control) -> None:
        """Set the meaning of the actions of all further steps, until the next reset.

        Raises:
            SubstrateError: There is no such mode.
        """

    def observe(self, cameras: Sequence[str] = CAMERAS, size: ImageSize = 256) -> dict[str, NDArray[Any]]:
        """Proprioception, and a (H, W, 3) uint8 image for each camera named (:data:`Observation`).

        The height decides how much is seen from top to bottom; a wider image shows more on both sides.
        """

    def visible_pixels(self, camera: str, size: int = 256) -> dict[str, int]:
        """Return the number of pixels of a (size, size) image that show each entity, occlusion included.

        The count is made before any pixel filter, which changes colours and hides no entity here.

        Raises:
            SubstrateError: No such camera.
        """

    def snapshot(self) -> WorldState:
        """Return a copy of everything that the future of the world depends on."""

    def restore(self, state: WorldState) -> None:
        """Return to a snapshot of this scene; another scene's is refused."""

    def digest(self) -> bytes:
        """32-byte fingerprint of the snapshot: equal states, equal digests, bit for bit."""

    def scene_fields(self) -> Mapping[str, str]:
        """Digest, by name, of each thing that the scene consists of and that no reset or event changes.

        Equal scenes have equal digests in every process; see :mod:`pytest_libero_max.worlds.scene_digest`.
        """

    def take_back_writes(self) -> tuple[str, ...]:
        """Undo every write to the model or its options that was not made through this contract.

        The fields that changes alter are part of the digest and restored by a reset; all others are fixed
        when the scene is built. The substrate builds a world anew where a field was too large to be put back.

        Returns:
            The fixed fields that had been written since the last call, for example ``opt.gravity``.
        """

    def succeeded(self) -> bool:
        """Return True if the task's goal predicates hold now."""

    def position(self, entity: str) -> Array:
        """(3,) m, world: the free joint of an object, the root body of a fixture.

        Raises:
            EntityError: No such entity; the message suggests the closest name.
        """

    def pose(self, entity: str) -> tuple[Array, Array]:
        """Position (3,) in m and orientation (4,) wxyz, both in the world frame."""

    def end_effector(self) -> Array:
        """(3,) m, world: the grip site between the fingers."""

    def contacts(self, entity: str) -> tuple[str, ...]:
        """Sorted names of what touches the entity now: entities, ``robot0``, ``gripper0``."""

    def fingers_on(self, entity: str) -> int:
        """Return the number of the gripper's fingers that touch the entity now.

        Raises:
            EntityError: No such entity.
        """

    def close(self) -> None:
        """Release GL contexts and memory. The world cannot be used afterwards."""


@runtime_checkable
class OnMujoco(World, Protocol):
    """A world whose simulator is MuJoCo, with its raw model and state. Their readers depend on MuJoCo."""

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model of the scene."""

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's state of the scene."""

    def geoms(self, entity: str) -> NDArray[np.intp]:
        """Return the numbers of the geoms that an entity consists of."""


@runtime_checkable
class PosedWorld(World, Protocol):
    """A world whose films can be drawn from kept positions, without simulating them again."""

    def posture(self) -> NDArray[np.float32]:
        """Return the positions (n,) of everything that moves, which decide with the scene what is seen."""

    def posed(self, state: WorldState, posture: NDArray[np.float32], steps: int) -> WorldState:
        """Return a snapshot with other positions and another number of control steps, to be looked at."""


@runtime_checkable
class AlterableWorld(World, Protocol):
    """A world that changes can alter. Nothing else writes to a world from outside.

    A scene is read and written as what it is, whatever simulates it: views of cameras, lights, surfaces,
    poses of entities, what is out of the scene, pixel filters, the arm's joints, instruction and goal. What
    was read and is written again has the same bits. Alterations belong to :class:`WorldState`, and a reset
    undoes them.
    """

    @property
    def semantics(self) -> Semantics:
        """``published`` if events keep the defects of the authors' code, which published numbers contain."""

    @property
    def assigned(self) -> tuple[str | None, Goal | None]:
        """Instruction and goal given since reset in place of the task's own; None where they were not."""

    @property
    def filters(self) -> tuple[tuple[PixelFilter, int], ...]:
        """The pixel filters in use, in their order, each with the step at which it was added."""

    def view(self, camera: str) -> CameraView:
        """Return pose and field of view of a camera.

        Raises:
            SubstrateError: No such camera.
        """

    def set_view(self, camera: str, view: CameraView) -> None:
        """Let a camera look from elsewhere."""

    def lights(self) -> Lights:
        """Return the lamps of the scene."""

    def set_lights(self, lights: Lights) -> None:
        """Let the lamps shine otherwise; their number stays."""

    @property
    def materials(self) -> tuple[str, ...]:
        """Names of the materials, by their numbers."""

    @property
    def textures(self) -> tuple[str, ...]:
        """Names of the textures that the scene has loaded, by their numbers."""

    def surfaces(self) -> Surfaces:
        """Return colours and textures of everything that can be seen."""

    def set_surfaces(self, surfaces: Surfaces) -> None:
        """Let surfaces look otherwise; the numbers of parts and materials stay."""

    def materials_of(self, entity: str) -> tuple[int, ...]:
        """Return the numbers of the materials that can be seen of an entity, sorted.

        Raises:
            EntityError: No such entity.
        """

    def velocity(self, entity: str) -> Array:
        """Return the linear velocity (3,) of an object, m/s, world frame."""

    def top_m(self, entity: str) -> float | None:
        """Return the height of the highest point of an entity that can be touched; None without any."""

    def radius_m(self, entity: str) -> float:
        """Return the distance from an entity's origin to the farthest point that can be touched, at most."""

    def arm_joints(self) -> Array:
        """Return the positions of the arm's joints as an observation would have them, rad."""

    def fingers(self) -> Array:
        """Return the positions of the gripper's fingers as an observation would have them, m."""

    def place(
        self,
        entity: str,
        position: Sequence[float] | Array,
        quaternion: Sequence[float] | Array | None = None,
    ) -> None:
        """Put an entity elsewhere, at rest; the orientation (wxyz) stays unless given. Nothing else moves."""

    def push(self, entity: str, velocity_m_s: Sequence[float] | Array) -> None:
        """Add (3,) m/s in the world frame to the linear velocity of an object; it stays where it is now.

        Raises:
            SubstrateError: The entity is no object, or is parked.
        """

    def park(self, entity: str, position: Sequence[float] | Array) -> None:
        """Take an object out of the scene: unseen, untouchable, weightless at ``position`` until unparked."""

    def unpark(
        self,
        entity: str,
        position: Sequence[float] | Array,
        quaternion: Sequence[float] | Array | None = None,
    ) -> None:
        """Bring a parked object back, at rest, by default in the orientation it had when it was parked."""

    def parked_pose(self, entity: str) -> tuple[Array, Array]:
        """Position (3,) and quaternion (4,) wxyz that a parked entity had when it was parked."""

    def other_task(self, suite: str, index: int) -> World:
        """Return a world of another task of LIBERO, as it is without variations, to be looked at.

        It is another simulation. Nobody else plays in it until the next world is asked of the substrate.

        Raises:
            SubstrateError: There is no such task, it is that of this world, or no substrate built this world.
        """

    def add_filter(self, filter: PixelFilter) -> None:
        """Let every later image of every camera pass through ``filter``, after those already there."""

    def remove_filter(self, index: int) -> None:
        """Remove the pixel filter ``filters[index]``; the others stay, in their order.

        Raises:
            SubstrateError: There is none.
        """

    def pose_arm(self, joints: Sequence[float] | Array) -> None:
        """Put the arm's joints there, rad, at rest; the controller then holds that pose.

        Raises:
            SubstrateError: The world has no such arm, or a joint would pass its limit.
        """

    def open_gripper(self) -> None:
        """Set the command of the fingers to open; actions that close the gripper take some steps to undo it.

        Raises:
            SubstrateError: The world has no such gripper.
        """

    def assign(self, instruction: str | None = None, goal: Goal | None = None) -> None:
        """Assign another instruction, another goal or both, in place of the task's own, until the next reset.

        Raises:
            SubstrateError: The goal names something that the scene does not have.
        """

    def reassign(self, assigned: tuple[str | None, Goal | None]) -> None:
        """Put back what :attr:`assigned` was earlier in the episode; None means the task's own."""


def alterable(world: World) -> AlterableWorld:
    """Return the world as one that changes can alter.

    Raises:
        SubstrateError: It is not one.
    """
    if not isinstance(world, AlterableWorld):
        raise SubstrateError(
            f"{world.scene} cannot be altered: a change needs the members of AlterableWorld, and "
            f"{type(world).__name__} lacks some. Play it on a substrate that has them."
        )
    return world


def on_mujoco(world: World) -> OnMujoco:
    """Return the world as one on MuJoCo.

    Raises:
        SubstrateError: Another simulator plays it.
    """
    if not isinstance(world, OnMujoco):
        raise SubstrateError(
            f"{world.scene} is not simulated by MuJoCo, whose arrays are read here. Play it on a substrate "
            "whose worlds are."
        )
    return world
