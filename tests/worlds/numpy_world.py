"""A world without MuJoCo: boxes on a table, a floating hand and a ray tracer, in NumPy alone.

It shows what the contract of worlds asks for, and nothing of any simulator: no model, no geoms, no clock. A
hand moves where actions say, closed fingers carry what is between them, things fall onto what is below them,
what was pushed slides to a stop. Robot, entities and cameras are arguments, so that the same world plays
another robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import EntityError, SubstrateError
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.base import WorldBase
from pytest_libero_max.worlds.contract import (
    Array,
    Entity,
    Goal,
    Image,
    ImageSize,
    WorldState,
    height_and_width,
)
from pytest_libero_max.worlds.robot import PANDA, Robot
from pytest_libero_max.worlds.scene_digest import value_digest
from pytest_libero_max.worlds.scenery import CameraView, Lights, Surfaces

STEP_M = 0.05
"""Way of the hand at a full action."""
INITS = 10
_HALF_HAND_M = np.array([0.015, 0.015, 0.02])
_FALL_M, _SLOWING, _GAP_M = 0.02, 0.8, 1e-4


@dataclass(frozen=True)
class Box:
    """A thing of the scene."""

    entity: Entity
    position_m: tuple[float, float, float]
    half_m: tuple[float, float, float]
    colour: tuple[float, float, float, float]


def _thing(name: str, category: str, position: Sequence[float], half: Sequence[float], *colour: float) -> Box:
    entity = Entity(name, category, "object", name, support="main_table")
    return Box(entity, tuple(position), tuple(half), (*colour, 1.0))  # type: ignore[arg-type]


BOXES = (
    Box(
        Entity("main_table", "table", "surface", "table"),
        (0, 0, 0.38),
        (0.45, 0.45, 0.02),
        (0.7, 0.6, 0.5, 1.0),
    ),
    Box(
        Entity("cabinet_1", "cabinet", "fixture", "cabinet", support="main_table"),
        (-0.35, 0.0, 0.47),
        (0.08, 0.1, 0.07),
        (0.5, 0.35, 0.2, 1.0),
    ),
    _thing("box_1", "box", (0.1, -0.1, 0.43), (0.03, 0.03, 0.03), 0.8, 0.2, 0.2),
    _thing("plate_1", "plate", (0.1, 0.15, 0.41), (0.08, 0.08, 0.01), 0.85, 0.85, 0.9),
    *(
        _thing(
            f"clutter_{number}",
            "clutter",
            (0.12 * number - 0.36, 0.3, 0.42),
            (0.02, 0.02, 0.02),
            red,
            0.5,
            0.3,
        )
        for number, red in enumerate((0.1, 0.3, 0.5, 0.7, 0.9), start=1)
    ),
)
"""The scene of the tiny world: the same names in the same places."""


def looking(position: Sequence[float], at: Sequence[float], fovy_deg: float = 45.0) -> CameraView:
    """Return the view of an upright camera."""
    back = np.subtract(position, at)
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    turn = rotations.of_axes(right, np.cross(back, right), back)
    return CameraView(np.array(position, dtype=float), np.array(turn), fovy_deg)


class NumpyWorld(WorldBase):
    """The scene of the tiny world without MuJoCo; see the module's text.

    Args:
        robot: Its last component is the gripper, the first three move the hand.
    """

    def __init__(self, robot: Robot = PANDA, scene: str = "numpy/0", boxes: Sequence[Box] = BOXES) -> None:
        self._boxes = tuple(boxes)
        self._names = [box.entity.name for box in boxes]
        self._half = np.array([box.half_m for box in boxes])
        self._movable = np.array([box.entity.kind == "object" for box in boxes])
        super().__init__(
            scene, "put the box on the plate", {box.entity.name: box.entity for box in boxes}, robot
        )
        self.reset(0)

    # Episodes.

    def reset(self, init: int) -> None:
        if not 0 <= init < INITS:
            raise SubstrateError.seen("init", init, f": this world has initial states 0 to {INITS - 1}.")
        self._begin_episode()
        self._place = np.array([box.position_m for box in self._boxes], dtype=float)
        self._place[self._names.index("box_1"), :2] += (0.008 * (init % 5), 0.008 * (init // 5))
        self._turn = np.tile((1.0, 0.0, 0.0, 0.0), (len(self._boxes), 1))
        self._speed = np.zeros((len(self._boxes), 3))
        self._hand = np.array([0.0, -0.25, 0.65])
        self._opening_m, self._held = 0.04, -1
        wrist = looking((0.1, 0.0, 0.1), (0.0, 0.0, -0.1), 75.0)
        views = [looking((1.0, 0.0, 1.1), (0.0, 0.0, 0.4)), wrist]
        self._views = dict(zip(self._robot.cameras, views, strict=False))
        count = len(self._boxes)
        self._lights = Lights(
            ambient=np.array([[0.3] * 3, [0.0] * 3]),
            diffuse=np.array([[0.6] * 3, [0.3] * 3]),
            specular=np.zeros((2, 3)),
            direction=np.array([[-0.3, -0.3, -1.0], [0.4, 0.2, -1.0]]),
            casts_shadow=np.array([True, False]),
        )
        self._surfaces = Surfaces(
            parts=np.array([box.colour for box in self._boxes]),
            material_of=np.array([0] + [-1] * (count - 1)),
            materials=np.array([[0.7, 0.6, 0.5, 1.0]]),
            textures=np.array([0]),
        )

    def step(self, action: Sequence[float] | Array) -> None:
        values = self._checked_action(action)
        target = (
            values[:3] if self._control == "absolute" else self._hand + STEP_M * values[:3].clip(-1.0, 1.0)
        )
        way = (target - self._hand).clip(-STEP_M, STEP_M)
        self._opening_m = float(np.clip(self._opening_m - 0.01 * np.sign(values[-1]), 0.0, 0.04))
        self._take_or_let_go()
        self._hand = np.clip(self._hand + way, (-0.5, -0.6, 0.42), (0.6, 0.6, 1.0))
        if self._held >= 0:
            self._place[self._held] = self._hand
        self._let_fall()
        self._steps += 1

    def _take_or_let_go(self) -> None:
        if self._opening_m > 0.02:
            self._held = -1
        elif self._held < 0:
            near = np.abs(self._place - self._hand) < self._half + 0.02
            able = near.all(axis=1) & self._movable & ~self._are_parked()
            self._held = int(np.argmax(able)) if able.any() else -1

    def _let_fall(self) -> None:
        for number in np.flatnonzero(self._movable & ~self._are_parked()):
            if number == self._held:
                continue
            self._place[number] += 0.05 * self._speed[number]
            self._speed[number] *= _SLOWING
            floor = self._height_below(int(number))
            bottom = self._place[number, 2] - self._half[number, 2]
            self._place[number, 2] -= np.clip(bottom - floor, 0.0, _FALL_M)

    def _height_below(self, number: int) -> float:
        """Return the height of what is below a thing, m."""
        at, half = self._place[number], self._half[number]
        over = (np.abs(self._place - at)[:, :2] < (self._half + half)[:, :2]).all(axis=1)
        tops = self._place[:, 2] + self._half[:, 2]
        below = over & (tops <= at[2] - half[2] + _GAP_M) & ~self._are_parked()
        below[number] = False
        return float(tops[below].max(initial=0.0))

    def _are_parked(self) -> NDArray[np.bool_]:
        return np.array([name in self._parked for name in self._names])

    # States.

    def snapshot(self) -> WorldState:
        views = np.array([np.concatenate(_numbers_of(view)) for view in self._views.values()])
        looks = {**vars(self._lights), **vars(self._surfaces), "views": views}
        return WorldState(
            scene=self._scene,
            physics=self._physics(),
            model={name: np.array(value) for name, value in looks.items()},
            controller=np.array([self._opening_m, float(self._held)]),
            steps=self._steps,
            filters=self._filters,
            parked=tuple(self._parked.items()),
            assigned=self._assigned,
            control=self._control,
        )

    def _physics(self) -> Array:
        return np.concatenate([part.ravel() for part in (self._place, self._turn, self._speed, self._hand)])

    def restore(self, state: WorldState) -> None:
        if state.scene != self._scene:
            raise SubstrateError(f"A state of {state.scene!r} cannot be restored into {self._scene!r}.")
        count = len(self._boxes)
        parts = np.split(state.physics.copy(), np.cumsum([3 * count, 4 * count, 3 * count]))
        self._place, self._turn = parts[0].reshape(-1, 3), parts[1].reshape(-1, 4)
        self._speed, self._hand = parts[2].reshape(-1, 3), parts[3]
        looks = {name: value.copy() for name, value in state.model.items()}
        self._views = {
            camera: CameraView(row[:3].copy(), row[3:7].copy(), float(row[7]))
            for camera, row in zip(self._views, looks.pop("views"), strict=True)
        }
        self._lights = Lights(**{name: looks[name] for name in vars(self._lights)})
        self._surfaces = Surfaces(**{name: looks[name] for name in vars(self._surfaces)})
        self._opening_m, self._held = float(state.controller[0]), int(state.controller[1])
        self._steps, self._filters, self._parked = state.steps, state.filters, dict(state.parked)
        self._assigned, self._control = state.assigned, state.control

    def digest(self) -> bytes:
        state = self.snapshot()
        fingerprint = blake2b(digest_size=32)
        for array in (state.physics, state.controller, *state.model.values()):
            fingerprint.update(array.tobytes())
        fingerprint.update(self._memory().encode() + self._control.encode())
        return fingerprint.digest()

    def posture(self) -> NDArray[np.float32]:
        return self._physics().astype(np.float32)

    def posed(self, state: WorldState, posture: NDArray[np.float32], steps: int) -> WorldState:
        return replace(state, physics=posture.astype(np.float64), steps=steps)

    def scene_fields(self) -> Mapping[str, str]:
        boxes = [(astuple(box.entity), box.position_m, box.half_m, box.colour) for box in self._boxes]
        values = {"boxes": boxes, "language": self._language, "robot": [self._robot.name, self._robot.noop]}
        return {name: value_digest(value) for name, value in values.items()}

    def take_back_writes(self) -> tuple[str, ...]:
        return ()  # nothing of the scene can be written to from outside

    # What is where.

    def position(self, entity: str) -> Array:
        return self.pose(entity)[0]

    def pose(self, entity: str) -> tuple[Array, Array]:
        number = self._number(entity)
        return self._place[number].copy(), self._turn[number].copy()

    def velocity(self, entity: str) -> Array:
        speed: Array = self._speed[self._number(entity)].copy()
        return speed

    def end_effector(self) -> Array:
        return self._hand.copy()

    def contacts(self, entity: str) -> tuple[str, ...]:
        number = self._number(entity)
        gaps = np.abs(self._place - self._place[number]) - self._half - self._half[number]
        touching = (gaps < _GAP_M).all(axis=1) & ~self._are_parked() & (entity not in self._parked)
        touching[number] = False
        names = [self._names[other] for other in np.flatnonzero(touching)]
        hand = np.abs(self._hand - self._place[number]) < self._half[number] + _HALF_HAND_M
        return tuple(sorted([*names, *["gripper0"] * bool(hand.all() and entity not in self._parked)]))

    def fingers_on(self, entity: str) -> int:
        return 2 if self._number(entity) == self._held else 0

    def succeeded(self) -> bool:
        goal = self._assigned[1] or (("on", "box_1", "plate_1"),)
        return all(self._is_on(*fact[1:]) for fact in goal)

    def _is_on(self, thing: str, place: str) -> bool:
        way = self.position(thing) - self.position(place)
        return bool(np.linalg.norm(way[:2]) < 0.05) and place in self.contacts(thing)

    def _check_goal(self, goal: Goal) -> None:
        for fact in goal:
            for name in fact[1:]:
                self._known(name)

    def _proprioception(self) -> dict[str, Array]:
        values = {key: np.zeros(size) for key, size in self._robot.state.items()}
        values[self._robot.joints_key][:3] = self._hand
        fingers = values[self._robot.fingers_key]
        fingers[:] = np.resize((self._opening_m, -self._opening_m), fingers.shape)
        for key in values:
            if key.endswith("eef_pos"):
                values[key][:] = self._hand
            elif key.endswith("eef_quat"):
                values[key][0] = 1.0
        return values

    # What a change alters.

    def place(
        self,
        entity: str,
        position: Sequence[float] | Array,
        quaternion: Sequence[float] | Array | None = None,
    ) -> None:
        if entity in self._parked:
            raise SubstrateError(f"{entity!r} is parked, so it cannot be placed: unpark it there instead.")
        self._put(self._number(entity), position, quaternion)

    def push(self, entity: str, velocity_m_s: Sequence[float] | Array) -> None:
        self._speed[self._number(entity)] += velocity_m_s

    def park(self, entity: str, position: Sequence[float] | Array) -> None:
        number = self._number(entity)
        if not self._movable[number] or entity in self._parked:
            raise SubstrateError(
                f"{entity!r} cannot be taken out of the scene: it is no object or parked already."
            )
        self._parked[entity] = (*self._place[number].tolist(), *self._turn[number].tolist())
        self._put(number, position, None)
        self._held = -1 if self._held == number else self._held

    def unpark(
        self,
        entity: str,
        position: Sequence[float] | Array,
        quaternion: Sequence[float] | Array | None = None,
    ) -> None:
        orientation = self.parked_pose(entity)[1] if quaternion is None else quaternion
        del self._parked[entity]
        self._put(self._number(entity), position, orientation)

    def _put(self, number: int, position: Any, quaternion: Any) -> None:
        self._place[number] = position
        if quaternion is not None:
            self._turn[number] = quaternion
        self._speed[number] = 0.0

    def pose_arm(self, joints: Sequence[float] | Array) -> None:
        self._hand = np.array(joints[:3], dtype=float)

    def open_gripper(self) -> None:
        self._opening_m, self._held = 0.04, -1

    def top_m(self, entity: str) -> float | None:
        number = self._number(entity)
        return float(self._place[number, 2] + self._half[number, 2])

    def radius_m(self, entity: str) -> float:
        return float(np.linalg.norm(self._half[self._number(entity)]))

    @property
    def cameras(self) -> tuple[str, ...]:
        return tuple(self._views)

    def view(self, camera: str) -> CameraView:
        if camera not in self._views:
            raise SubstrateError.seen("camera", camera, f", but there are {', '.join(self._views)}.")
        return self._views[camera]

    def set_view(self, camera: str, view: CameraView) -> None:
        self._views[camera] = view

    def lights(self) -> Lights:
        return Lights(**{name: value.copy() for name, value in vars(self._lights).items()})

    def set_lights(self, lights: Lights) -> None:
        self._lights = lights

    def surfaces(self) -> Surfaces:
        return Surfaces(**{name: value.copy() for name, value in vars(self._surfaces).items()})

    def set_surfaces(self, surfaces: Surfaces) -> None:
        self._surfaces = surfaces

    @property
    def materials(self) -> tuple[str, ...]:
        return ("wood",)

    @property
    def textures(self) -> tuple[str, ...]:
        return ("planks", "marble")

    def materials_of(self, entity: str) -> tuple[int, ...]:
        material = int(self._surfaces.material_of[self._number(entity)])
        return () if material < 0 else (material,)

    def _number(self, entity: str) -> int:
        if entity not in self._names:
            raise EntityError.seen("entity", entity, " is not in the scene.")
        return self._names.index(entity)

    # What is seen.

    def visible_pixels(self, camera: str, size: int = 256) -> dict[str, int]:
        shown = self._hits(camera, size)[0]
        return {name: n for number, name in enumerate(self._names) if (n := int((shown == number).sum()))}

    def _drawn(self, camera: str, size: ImageSize) -> Image:
        shown, normals = self._hits(camera, size)
        colours = np.vstack([self._surfaces.parts[:, :3], [[0.9, 0.9, 0.9]], [[0.2, 0.25, 0.3]]])
        light = self._lights.ambient.sum(axis=0) + np.zeros((*normals.shape[:2], 3))
        for way, diffuse in zip(self._lights.direction, self._lights.diffuse, strict=True):
            towards = -way / np.linalg.norm(way)
            light += (normals @ towards).clip(0.0)[..., None] * diffuse
        light[shown == len(self._boxes) + 1] = 1.0
        image: Image = (255.0 * (colours[shown] * light).clip(0.0, 1.0)).astype(np.uint8)
        return image

    def _hits(self, camera: str, size: ImageSize) -> tuple[NDArray[np.intp], Array]:
        """Return what each pixel shows, bottom row first: a box, the hand, nothing; and (h, w, 3) normals."""
        height, width = height_and_width(size)
        view = self.view(camera)
        origin = view.position_m + (self._hand if camera == self._robot.cameras[-1] else 0.0)
        frame = rotations.matrix(rotations.quaternion(view.quaternion_wxyz))
        focal = 0.5 * height / math.tan(math.radians(view.fovy_deg) / 2)
        rows, columns = np.mgrid[0:height, 0:width] + 0.5
        rays = np.stack(
            [(columns - width / 2) / focal, (rows - height / 2) / focal, -np.ones((height, width))], -1
        )
        rays = rays @ frame.T
        places, halves = np.vstack([self._place, self._hand]), np.vstack([self._half, _HALF_HAND_M])
        turns = np.vstack([self._turn, (1.0, 0.0, 0.0, 0.0)])
        shown = np.full((height, width), len(places))
        nearest, normals = np.full((height, width), np.inf), np.zeros((height, width, 3))
        for number, (place, half, turn) in enumerate(zip(places, halves, turns, strict=True)):
            if number < len(self._names) and self._names[number] in self._parked:
                continue
            window = _window((place - origin) @ frame, float(np.linalg.norm(half)), focal, height, width)
            own = rotations.matrix(rotations.quaternion(turn))
            distance, normal = _box_hits((origin - place) @ own, rays[window] @ own, half)
            closer = distance < nearest[window]
            nearest[window][closer], shown[window][closer] = distance[closer], number
            normals[window][closer] = normal[closer] @ own.T
        return shown, normals

    def close(self) -> None:
        pass


def _window(at: Array, radius: float, focal: float, height: int, width: int) -> tuple[slice, slice]:
    """Return rows and columns of the pixels that can show a ball, which is here in the camera's frame."""
    near = -at[2] - radius
    if near < 0.05:
        return slice(0, height), slice(0, width)
    reach = focal * radius / near * 1.5 + 2.0
    row, column = height / 2 - focal * at[1] / at[2], width / 2 - focal * at[0] / at[2]
    rows, columns = ((max(0, int(middle - reach)), max(0, int(middle + reach))) for middle in (row, column))
    return slice(*rows), slice(*columns)


def _box_hits(origin: Array, rays: Array, half: Array) -> tuple[Array, Array]:
    """Return the distances (h, w) along rays at which they enter a box, infinite where not, and normals."""
    safe = np.where(np.abs(rays) < 1e-12, 1e-12, rays)
    first, second = (-half - origin) / safe, (half - origin) / safe
    entries, exits = np.minimum(first, second), np.maximum(first, second)
    axis, entry = entries.argmax(axis=-1), entries.max(axis=-1)
    normals = np.eye(3)[axis] * -np.sign(np.take_along_axis(safe, axis[..., None], -1))
    return np.where((entry < exits.min(axis=-1)) & (entry > 0.0), entry, np.inf), normals


def _numbers_of(view: CameraView) -> tuple[Array, Array, Array]:
    return view.position_m, view.quaternion_wxyz, np.array([view.fovy_deg])


class NumpySubstrate:
    """Plays every case in one :class:`NumpyWorld`."""

    name = "numpy"

    def __init__(self, world: NumpyWorld | None = None) -> None:
        self._world = world or NumpyWorld()

    def world(self, case: Case) -> NumpyWorld:
        return self._world

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        return {"substrate": self.name, "numpy": np.__version__}

    def close(self) -> None:
        self._world.close()
