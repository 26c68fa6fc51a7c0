"""The catalogue of LIBERO-Plus: 10,030 variations in seven categories and five levels of difficulty.

The numbers of variations of each kind and task are LIBERO-Plus's own (``plus_counts.toml``), so are ranges of
the parameters where they are published: camera moves, start poses, image corruptions, slots and radii of
layouts. What the original keeps in data files is chosen here in the same spirit: the lamps' colours,
directions, gloss and shadows, the surfaces, and all words.

Of each task's candidates for a kind (fifty for a category, as in LIBERO-Plus) a hash keeps as many as there
are to be. Difficulty is the rank of a variation's magnitude among those of its category and suite; in
LIBERO-Plus it comes from the success of reference policies.

The registry of a suite is ordered by category, in the order of :data:`.PLUS_CATEGORIES`, then by task, then
by kind and candidate. These indices are our own and not LIBERO-Plus's.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from pytest_libero_max.benchmark.documents import Json, read_text, slug
from pytest_libero_max.changes.camera import OrbitCamera
from pytest_libero_max.changes.image_corruptions import KINDS as CORRUPTIONS
from pytest_libero_max.changes.image_corruptions import LEVELS
from pytest_libero_max.changes.instruction import SetInstruction
from pytest_libero_max.changes.light import SetLamps
from pytest_libero_max.changes.material import SetTexture
from pytest_libero_max.changes.pixels import CorruptPicture
from pytest_libero_max.changes.robot import OffsetArm
from pytest_libero_max.substrates.embedded.arenas import ARENAS, Arena
from pytest_libero_max.substrates.embedded.catalogue import object_layouts as layouts
from pytest_libero_max.substrates.embedded.catalogue import wording
from pytest_libero_max.substrates.embedded.surfaces import SURFACES, shown
from pytest_libero_max.substrates.variation import Variation, seed, share, some, uniform
from pytest_libero_max.tasks.libero_tasks import Task
from pytest_libero_max.tasks.libero_tasks import task as task_of
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.robot import PANDA


@cache
def _tables() -> dict[str, Any]:
    return tomllib.loads(read_text(Path(__file__).with_name("plus_counts.toml")))


def _frozen(rows: Mapping[str, list[int]]) -> Mapping[str, tuple[int, ...]]:
    return MappingProxyType({name: tuple(row) for name, row in rows.items()})


KINDS: tuple[str, ...] = tuple(_tables()["kinds"])
"""The columns of :data:`VARIATIONS`."""

VARIATIONS: Mapping[str, tuple[tuple[int, ...], ...]] = MappingProxyType(
    {suite: tuple(map(tuple, rows)) for suite, rows in _tables()["variations"].items()}
)
"""Variations of each unmodified task by kind, in the suite's order of tasks."""

DIFFICULTY: Mapping[str, Mapping[str, tuple[int, ...]]] = MappingProxyType(
    {category: _frozen(suites) for category, suites in _tables()["difficulty"].items()}
)
"""Variations of difficulty 1 to 5, and of none, by category and suite. The order of the categories is that of
the registry."""

CAMERA = "agentview"

KINDS_OF = MappingProxyType(
    {
        "Background Textures": ("table", "table_and_wall"),
        "Robot Initial States": ("robot",),
        "Camera Viewpoints": ("spherical", "distance", "orientation"),
        "Language Instructions": ("language",),
        "Sensor Noise": ("noise",),
        "Objects Layout": ("add", "level"),
        "Light Conditions": ("light",),
    }
)
"""Columns of the counts that make up a category."""

# Published: start of each task's fifteen degrees of azimuth, and its yaw on the spot.
_AZIMUTH = (1, 16, 31, 46, 61, -75, -60, -45, -30, -15)
_YAW = (2, 4, 6, 8, 10, -10, -8, -6, -4, -2)
_ELEVATIONS = (0, 15)
_PITCHES = (-10, -8, -6, -4, -2, 2, 4, 6, 8, 10)
# Turns that bring the main lamp over the robot's back and over the camera: a wall stands on every other side.
_FROM_BEHIND_DEG, _FROM_THE_FRONT_DEG = 141.0, -39.0
_BANDS = 5
_POSES = 500
_POSE_SEED = 42


@dataclass(frozen=True)
class _Candidate:
    """A possible variation: its kind, its size (only the order counts), its changes and its scene.

    Where ``make`` is given, it returns changes and scene, which take long to find.
    """

    kind: str
    magnitude: float
    changes: tuple[Json, ...] = ()
    scene: Json = field(default_factory=dict)
    make: Callable[[], tuple[tuple[Json, ...], Json]] | None = None


def plus_count(suite: str) -> int:
    """Return the number of variations of a suite."""
    return sum(map(sum, VARIATIONS[suite]))


@cache
def plus_suite(suite: str) -> tuple[Variation, ...]:
    """Every variation of a suite, in the order of its registry, or raise SubstrateError."""
    return tuple(plus_variation(suite, index) for index in range(plus_count(suite)))


@cache
def plus_variation(suite: str, index: int) -> Variation:
    """Return one variation of a suite, without making the others.

    Args:
        index: Index in :func:`plus_suite`.
    """
    place = index
    for category in PLUS_CATEGORIES:
        ranked = sum(DIFFICULTY[category][suite])
        if place < ranked:
            break
        place -= ranked
    base, number, candidate, level = _ranked(suite, category)[place]
    changes, scene = candidate.make() if candidate.make else (candidate.changes, candidate.scene)
    name = f"{task_of(suite, base).name}_{slug(category)}_{number:02d}"
    return Variation("plus", suite, index, base, name, category, candidate.kind, level, scene, changes)


@cache
def _ranked(suite: str, category: str) -> tuple[tuple[int, int, _Candidate, int | None], ...]:
    """Return the kept candidates of a category with task, number from 1 within it, and difficulty."""
    chosen = [
        (base, number, candidate)
        for base in range(len(VARIATIONS[suite]))
        for number, candidate in _chosen(suite, base, category)
    ]
    levels = _difficulties(suite, category, [candidate.magnitude for *_, candidate in chosen])
    return tuple((*entry, level) for entry, level in zip(chosen, levels, strict=True))


def _chosen(suite: str, base: int, category: str) -> Iterator[tuple[int, _Candidate]]:
    """Yield the candidates that a hash keeps, with their numbers, from 1, within the category."""
    task = task_of(suite, base)
    number = 0
    for kind in KINDS_OF[category]:
        candidates = list(enumerate(_MAKERS[kind](task), start=number + 1))
        number += len(candidates)
        count = VARIATIONS[suite][base][KINDS.index(kind)]
        yield from some(candidates, count, suite, base, kind)


def _difficulties(suite: str, category: str, magnitudes: list[float]) -> list[int | None]:
    """Return levels by rank, as many of each as LIBERO-Plus has; a hash selects those without one."""
    *counts, none = DIFFICULTY[category][suite]
    numbers = sorted(range(len(magnitudes)), key=lambda n: share(suite, category, "level", n))
    levels: list[int | None] = [None] * len(magnitudes)
    ranked = iter(sorted(numbers[none:], key=lambda n: magnitudes[n]))
    for level, count in enumerate(counts, start=1):
        for _ in range(count):
            levels[next(ranked)] = level
    return levels


# --- what each kind consists of
# ------------------------------------------------------------------------------------------------


@cache
def _room(kind: str) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
    """Return the material of a room's work surface, and the looks of that and of the walls."""
    arena = ARENAS[kind]
    material, picture = ("room_table", arena.top()) if arena.solids else ("room_floor", arena.floor())
    return material, _mean_and_spread(picture), _mean_and_spread(arena.wall())


def _table(task: Task) -> Iterator[_Candidate]:
    material, nominal, _ = _room(task.arena)
    for name in SURFACES:
        change = SetTexture(material, shown(name)).to_dict()
        yield _Candidate("table", _contrast(name, nominal), (change,), {"surfaces": [name]})


def _table_and_wall(task: Task) -> Iterator[_Candidate]:
    material, nominal, wall = _room(task.arena)
    pairs = [
        (table, wall_surface) for table in SURFACES for wall_surface in SURFACES if table != wall_surface
    ]
    for table, wall_surface in some(pairs, 23, task.name, "table_and_wall"):
        changes = (
            SetTexture(material, shown(table)).to_dict(),
            SetTexture("room_wall", shown(wall_surface)).to_dict(),
        )
        magnitude = _contrast(table, nominal) + _contrast(wall_surface, wall)
        yield _Candidate("table_and_wall", magnitude, changes, {"surfaces": [table, wall_surface]})


@cache
def _looks(name: str) -> tuple[float, ...]:
    return _mean_and_spread(SURFACES[name]())


def _mean_and_spread(picture: Image) -> tuple[float, ...]:
    pixels = picture.reshape(-1, 3).astype(np.float64)
    return (*(float(part) for part in pixels.mean(axis=0)), float(pixels.std(axis=0).mean()))


def _contrast(name: str, nominal: tuple[float, ...]) -> float:
    """Difference of a surface from the present one, by mean colour and by the spread of colours."""
    return math.dist(_looks(name), nominal)


def _pivot(arena: Arena) -> tuple[float, float, float]:
    """Return the pivot: 10 cm below the table's top (LIBERO-Plus uses one height for all rooms)."""
    return (0.0, 0.0, round(max(arena.top_z - 0.1, 0.0), 6))


def _spherical(task: Task) -> Iterator[_Candidate]:
    pivot = _pivot(ARENAS[task.arena])
    for elevation in _ELEVATIONS:
        for degree in range(15):
            azimuth = _AZIMUTH[task.index] + degree
            change = OrbitCamera(CAMERA, pivot, float(elevation), float(azimuth)).to_dict()
            yield _Candidate("spherical", math.hypot(azimuth, elevation) / 76.0, (change,))


def _distance(task: Task) -> Iterator[_Candidate]:
    pivot = _pivot(ARENAS[task.arena])
    for percent in range(101 + 10 * task.index, 111 + 10 * task.index):
        change = OrbitCamera(CAMERA, pivot, distance_scale=percent / 100).to_dict()
        yield _Candidate("distance", (percent - 100) / 100, (change,))


def _orientation(task: Task) -> Iterator[_Candidate]:
    pivot = _pivot(ARENAS[task.arena])
    yaw = _YAW[task.index]
    for pitch in _PITCHES:
        change = OrbitCamera(CAMERA, pivot, yaw_degrees=float(yaw), pitch_degrees=float(pitch)).to_dict()
        yield _Candidate("orientation", math.hypot(yaw, pitch) / 14.2, (change,))


def _language(task: Task) -> Iterator[_Candidate]:
    for words in wording.rewordings(task.language):
        change = SetInstruction(words.words, words.style).to_dict()
        yield _Candidate("language", wording.STYLES.index(words.style) + len(words.words) / 1000, (change,))


def _light(task: Task) -> Iterator[_Candidate]:
    makers = (_colour, _direction, _gloss, _shadow)
    for number in range(50):
        strength = (number // 4 + 1) / 13
        change = makers[number % 4](strength, (task.name, "light", number))
        yield _Candidate("light", strength, (change.to_dict(),))


def _colour(strength: float, where: tuple[object, ...]) -> SetLamps:
    """Lamps of another colour and brightness: each channel between two fifths and two and a half times."""
    channels = [uniform(-1.0, 1.0, *where, channel) for channel in range(3)]
    widest = max(abs(channel) for channel in channels)
    r, g, b = (round(2.5 ** (strength * channel / widest), 6) for channel in channels)
    return SetLamps(diffuse_factor=(r, g, b))


def _direction(strength: float, where: tuple[object, ...]) -> SetLamps:
    """Lamps that shine from somewhere else."""
    side = 1.0 if share(*where, "side") < 0.5 else -1.0
    azimuth = side * (30.0 + 150.0 * strength) * uniform(0.8, 1.0, *where, "azimuth")
    return SetLamps(azimuth_degrees=round(azimuth, 6), tilt_degrees=round(40.0 * strength, 6))


def _gloss(strength: float, where: tuple[object, ...]) -> SetLamps:
    """Lamps behind the robot, whose reflections reach the camera."""
    specular = round(1.0 + 9.0 * strength, 6)
    return SetLamps(specular=specular, azimuth_degrees=_FROM_BEHIND_DEG, tilt_degrees=10.0)


def _shadow(strength: float, where: tuple[object, ...]) -> SetLamps:
    """Return a main lamp in front that casts shadows, longer ones in stronger variations."""
    azimuth = round(_FROM_THE_FRONT_DEG + uniform(-25.0, 25.0, *where, "azimuth"), 6)
    tilt = round(-20.0 + 28.0 * strength, 6)
    return SetLamps(azimuth_degrees=azimuth, tilt_degrees=tilt, cast_shadows=True)


def _add(task: Task) -> Iterator[_Candidate]:
    def made(number: int) -> tuple[tuple[Json, ...], Json]:
        extras, changes = layouts.added_objects(task, number)
        return changes, {"extras": [list(extra) for extra in extras]}

    for number in range(1, 31):
        yield _Candidate("add", layouts.added_count(number), make=partial(made, number))


def _level(task: Task) -> Iterator[_Candidate]:
    def made(level: int, sample: int) -> tuple[tuple[Json, ...], Json]:
        return layouts.shifted_objects(task, level, sample), {}

    for level in range(1, layouts.LEVELS + 1):
        for sample in range(1, 5):
            yield _Candidate("level", level, make=partial(made, level, sample))


def _robot(task: Task) -> Iterator[_Candidate]:
    for number in range(task.index, _POSES, 10):
        change = OffsetArm(start_offset(number), keep_clear=True).to_dict()
        yield _Candidate("robot", number // (_POSES // _BANDS), (change,))


def start_offset(number: int) -> tuple[float, ...]:
    """LIBERO-Plus's 500 start poses, as (7,) joint offsets in rad from the nominal pose.

    Its published recipe: directions from NumPy's legacy generator with seed 42, lengths from 0.1 rad for the
    first hundred to 0.5 rad for the last.
    """
    length = 0.1 * (number // (_POSES // _BANDS) + 1)
    return tuple(round(float(part) * length, 8) for part in _directions()[number])


@cache
def _directions() -> np.ndarray:
    drawn = np.random.RandomState(_POSE_SEED).randn(_POSES, len(PANDA.arm_joints))
    directions: np.ndarray = drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
    return directions


def _noise(task: Task) -> Iterator[_Candidate]:
    for kind in CORRUPTIONS:
        for level in range(1, LEVELS + 1):
            number = seed(task.name, "noise", kind, level)
            change = CorruptPicture(CAMERA, kind, level, number).to_dict()
            yield _Candidate("noise", level, (change,))


_MAKERS: Mapping[str, Callable[[Task], Iterator[_Candidate]]] = MappingProxyType(
    {
        "table": _table,
        "table_and_wall": _table_and_wall,
        "spherical": _spherical,
        "distance": _distance,
        "orientation": _orientation,
        "language": _language,
        "light": _light,
        "add": _add,
        "level": _level,
        "robot": _robot,
        "noise": _noise,
    }
)
