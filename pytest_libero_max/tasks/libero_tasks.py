"""The tasks of LIBERO as data: instructions, places of things, and the goal.

Names, instructions, places and goals are LIBERO's own. A row holds the differences of a task from the
others of its suite; everything that follows from that is derived here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.tasks.layouts import LAYOUTS, Arena
from pytest_libero_max.worlds.privileged import Fact

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Place:
    """A rectangle of the table or floor in which something is put at reset."""

    name: str
    """As in LIBERO, for example ``main_table_plate_region``."""
    surface: str
    """For example ``main_table`` or ``floor``."""
    box: Box
    """(x_min, y_min, x_max, y_max) in m, world."""
    yaw: float = 0.0
    """Turn about z of a fixture that is put here, rad."""


@dataclass(frozen=True)
class Task:
    """One task."""

    suite: str
    index: int
    """Position in the benchmark's own order."""
    language: str
    """The instruction that the benchmark gives to a policy."""
    arena: Arena
    objects: tuple[str, ...]
    """Instances that move freely, in the order of their joints."""
    fixtures: tuple[str, ...]
    """Instances that are bolted down, in the order of their joints."""
    places: Mapping[str, Place]
    """Rectangles by name."""
    start: tuple[Fact, ...]
    """Facts that hold at reset."""
    goal: tuple[Fact, ...]
    """Facts that must all hold at the end."""
    scene: str = ""
    """LIBERO-90's name of the scene, with which the names of LIBERO-10's files begin."""

    @property
    def name(self) -> str:
        """The stem of its BDDL file."""
        words = self.language.replace(" ", "_")
        return f"{self.scene}_{words}" if self.scene else words


def category_of(instance: str) -> str:
    """``akita_black_bowl`` for ``akita_black_bowl_1``."""
    return instance.rpartition("_")[0]


def _square(x: float, y: float, half: float) -> Box:
    return (round(x - half, 6), round(y - half, 6), round(x + half, 6), round(y + half, 6))


# --- LIBERO-Spatial: two bowls, the same table
# ---------------------------------------------------------------------

_TABLE_PLACES: Mapping[str, Box] = MappingProxyType(
    {
        "between_plate_ramekin_region": _square(-0.05, 0.20, 0.01),
        "box_region": _square(0.07, 0.03, 0.01),
        "cabinet_region": _square(0.03, -0.27, 0.01),
        "next_to_box_region": _square(0.13, -0.07, 0.01),
        "next_to_plate_region": _square(0.01, 0.31, 0.01),
        "next_to_ramekin_region": _square(-0.18, 0.32, 0.01),
        "plate_region": _square(0.06, 0.20, 0.01),
        "ramekin_region": _square(-0.20, 0.20, 0.01),
        "stove_region": _square(-0.41, -0.14, 0.01),
        "table_center": (-0.10, -0.01, -0.05, 0.01),
        "table_front": _square(0.20, 0.0, 0.01),
    }
)
# LIBERO turns the cabinet by 2.661 to 2.724 rad; this is the middle.
_CABINET_YAW = 2.6928

_STOVE, _CABINET_TOP, _DRAWER = (
    "flat_stove_1_cook_region",
    "wooden_cabinet_1_top_side",
    "wooden_cabinet_1_top_region",
)

# The words for the first bowl's place, the place of the first bowl, the place of the second.
_SPATIAL: tuple[tuple[str, str, str], ...] = (
    ("between the plate and the ramekin", "between_plate_ramekin_region", "next_to_ramekin_region"),
    ("next to the ramekin", "next_to_ramekin_region", "next_to_box_region"),
    ("from table center", "table_center", "next_to_plate_region"),
    ("on the cookie box", "cookies_1", _CABINET_TOP),
    ("in the top drawer of the wooden cabinet", _DRAWER, _CABINET_TOP),
    ("on the ramekin", "glazed_rim_porcelain_ramekin_1", "cookies_1"),
    ("next to the cookie box", "next_to_box_region", _STOVE),
    ("on the stove", _STOVE, _CABINET_TOP),
    ("next to the plate", "next_to_plate_region", "next_to_ramekin_region"),
    ("on the wooden cabinet", _CABINET_TOP, _STOVE),
)


def _spatial(index: int) -> Task:
    words, first, second = _SPATIAL[index]
    places = {
        f"main_table_{key}": Place(
            f"main_table_{key}", "main_table", box, _CABINET_YAW if key == "cabinet_region" else 0.0
        )
        for key, box in _TABLE_PLACES.items()
    }

    def put(instance: str, place: str) -> Fact:
        if place == _DRAWER:
            return Fact("in", instance, place)
        return Fact("on", instance, f"main_table_{place}" if place in _TABLE_PLACES else place)

    start = [
        put("plate_1", "plate_region"),
        put("cookies_1", "box_region"),
        put("glazed_rim_porcelain_ramekin_1", "ramekin_region"),
        put("wooden_cabinet_1", "cabinet_region"),
        put("flat_stove_1", "stove_region"),
        put("akita_black_bowl_1", first),
        put("akita_black_bowl_2", second),
    ]
    if first == _DRAWER:
        start.append(Fact("open", _DRAWER))
    return Task(
        "libero_spatial",
        index,
        f"pick up the black bowl {words} and place it on the plate",
        "tabletop",
        (
            "akita_black_bowl_1",
            "akita_black_bowl_2",
            "cookies_1",
            "glazed_rim_porcelain_ramekin_1",
            "plate_1",
        ),
        ("wooden_cabinet_1", "flat_stove_1"),
        places,
        tuple(start),
        (Fact("on", "akita_black_bowl_1", "plate_1"),),
    )


# --- LIBERO-Object: groceries and a basket on the floor
# --------------------------------------------------------------

_FAR, _NEAR = (-0.12, -0.24), (0.05, -0.10)
_FLOOR_SPOTS = ((-0.15, 0.06), (0.10, -0.20), (0.15, 0.03), (-0.20, -0.08))
_BASKET_SPOT = (0.0, 0.26)

# What goes into the basket, where it stands, and the five others in the order of their regions; the first
# of the others takes whichever of the spots _FAR and _NEAR is left.
_OBJECT: tuple[tuple[str, tuple[float, float], str], ...] = (
    ("alphabet_soup", _FAR, "salad_dressing cream_cheese milk tomato_sauce butter"),
    ("cream_cheese", _NEAR, "alphabet_soup milk tomato_sauce butter orange_juice"),
    ("salad_dressing", _NEAR, "ketchup alphabet_soup cream_cheese milk tomato_sauce"),
    ("bbq_sauce", _NEAR, "chocolate_pudding ketchup salad_dressing alphabet_soup cream_cheese"),
    ("ketchup", _FAR, "bbq_sauce salad_dressing alphabet_soup cream_cheese milk"),
    ("tomato_sauce", _NEAR, "milk butter orange_juice chocolate_pudding bbq_sauce"),
    ("butter", _FAR, "tomato_sauce orange_juice chocolate_pudding bbq_sauce ketchup"),
    ("milk", _FAR, "cream_cheese tomato_sauce butter orange_juice chocolate_pudding"),
    ("chocolate_pudding", _FAR, "orange_juice bbq_sauce ketchup salad_dressing alphabet_soup"),
    ("orange_juice", _NEAR, "butter chocolate_pudding bbq_sauce ketchup salad_dressing"),
)


def _object(index: int) -> Task:
    target, spot, others = _OBJECT[index]
    spots = {"target_object_region": spot, "other_object_region_0": _NEAR if spot == _FAR else _FAR}
    spots |= {f"other_object_region_{n}": place for n, place in enumerate(_FLOOR_SPOTS, start=1)}
    places = {
        f"floor_{key}": Place(f"floor_{key}", "floor", _square(*xy, 0.025)) for key, xy in spots.items()
    }
    places["floor_bin_region"] = Place("floor_bin_region", "floor", _square(*_BASKET_SPOT, 0.01))
    instances = [f"{name}_1" for name in (target, *others.split())]
    start = [Fact("on", name, f"floor_{key}") for name, key in zip(instances, spots, strict=True)]
    return Task(
        "libero_object",
        index,
        f"pick up the {target.replace('_', ' ')} and place it in the basket",
        "floor",
        (instances[0], "basket_1", *instances[1:]),
        (),
        places,
        (*start, Fact("on", "basket_1", "floor_bin_region")),
        (Fact("in", instances[0], "basket_1_contain_region"),),
    )


# --- LIBERO-Goal: one scene, ten things to do in it
# ------------------------------------------------------------------

_GOAL_PLACES: Mapping[str, Place] = MappingProxyType(
    {
        f"main_table_{key}": Place(f"main_table_{key}", "main_table", box, yaw)
        for key, box, yaw in (
            ("akita_black_bowl_region", _square(-0.09, 0.0, 0.01), 0.0),
            ("cabinet_region", _square(0.03, -0.24, 0.01), math.pi),
            ("cream_cheese_region", _square(-0.05, 0.13, 0.01), 0.0),
            ("plate_region", _square(0.05, -0.02, 0.01), 0.0),
            ("stove_front_region", _square(-0.05, 0.21, 0.04), 0.0),
            ("stove_region", _square(-0.41, 0.21, 0.01), 0.0),
            ("wine_bottle_region", _square(-0.20, -0.05, 0.01), 0.0),
            ("wine_rack_region", _square(-0.26, -0.26, 0.01), math.pi),
        )
    }
)

_BOWL = "akita_black_bowl_1"

# The instruction, and what it asks for.
_GOAL: tuple[tuple[str, Fact], ...] = (
    ("open the middle drawer of the cabinet", Fact("open", "wooden_cabinet_1_middle_region")),
    ("put the bowl on the stove", Fact("on", _BOWL, _STOVE)),
    ("put the wine bottle on top of the cabinet", Fact("on", "wine_bottle_1", _CABINET_TOP)),
    ("open the top drawer and put the bowl inside", Fact("in", _BOWL, _DRAWER)),
    ("put the bowl on top of the cabinet", Fact("on", _BOWL, _CABINET_TOP)),
    ("push the plate to the front of the stove", Fact("on", "plate_1", "main_table_stove_front_region")),
    ("put the cream cheese in the bowl", Fact("on", "cream_cheese_1", _BOWL)),
    ("turn on the stove", Fact("turnon", "flat_stove_1")),
    ("put the bowl on the plate", Fact("on", _BOWL, "plate_1")),
    ("put the wine bottle on the rack", Fact("on", "wine_bottle_1", "wine_rack_1_top_region")),
)


def _goal(index: int) -> Task:
    language, goal = _GOAL[index]
    start = (
        ("wine_bottle_1", "wine_bottle_region"),
        (_BOWL, "akita_black_bowl_region"),
        ("plate_1", "plate_region"),
        ("cream_cheese_1", "cream_cheese_region"),
        ("wooden_cabinet_1", "cabinet_region"),
        ("flat_stove_1", "stove_region"),
        ("wine_rack_1", "wine_rack_region"),
    )
    return Task(
        "libero_goal",
        index,
        language,
        "tabletop",
        (_BOWL, "cream_cheese_1", "wine_bottle_1", "plate_1"),
        ("wooden_cabinet_1", "flat_stove_1", "wine_rack_1"),
        _GOAL_PLACES,
        tuple(Fact("on", name, f"main_table_{place}") for name, place in start),
        (goal,),
    )


# --- LIBERO-10: ten long tasks in kitchens, living rooms and a study
# -----------------------------------------------------

_IN_BASKET = "basket_1_contain_region"

# The scene, the instruction, and what it asks for.
_TEN: tuple[tuple[str, str, tuple[Fact, ...]], ...] = (
    (
        "LIVING_ROOM_SCENE2",
        "put both the alphabet soup and the tomato sauce in the basket",
        (Fact("in", "alphabet_soup_1", _IN_BASKET), Fact("in", "tomato_sauce_1", _IN_BASKET)),
    ),
    (
        "LIVING_ROOM_SCENE2",
        "put both the cream cheese box and the butter in the basket",
        (Fact("in", "cream_cheese_1", _IN_BASKET), Fact("in", "butter_1", _IN_BASKET)),
    ),
    (
        "KITCHEN_SCENE3",
        "turn on the stove and put the moka pot on it",
        (Fact("turnon", "flat_stove_1"), Fact("on", "moka_pot_1", _STOVE)),
    ),
    (
        "KITCHEN_SCENE4",
        "put the black bowl in the bottom drawer of the cabinet and close it",
        (Fact("close", "white_cabinet_1_bottom_region"), Fact("in", _BOWL, "white_cabinet_1_bottom_region")),
    ),
    (
        "LIVING_ROOM_SCENE5",
        "put the white mug on the left plate and put the yellow and white mug on the right plate",
        (Fact("on", "porcelain_mug_1", "plate_1"), Fact("on", "white_yellow_mug_1", "plate_2")),
    ),
    (
        "STUDY_SCENE1",
        "pick up the book and place it in the back compartment of the caddy",
        (Fact("in", "black_book_1", "desk_caddy_1_back_contain_region"),),
    ),
    (
        "LIVING_ROOM_SCENE6",
        "put the white mug on the plate and put the chocolate pudding to the right of the plate",
        (
            Fact("on", "porcelain_mug_1", "plate_1"),
            Fact("on", "chocolate_pudding_1", "living_room_table_plate_right_region"),
        ),
    ),
    (
        "LIVING_ROOM_SCENE1",
        "put both the alphabet soup and the cream cheese box in the basket",
        (Fact("in", "alphabet_soup_1", _IN_BASKET), Fact("in", "cream_cheese_1", _IN_BASKET)),
    ),
    (
        "KITCHEN_SCENE8",
        "put both moka pots on the stove",
        (Fact("on", "moka_pot_1", _STOVE), Fact("on", "moka_pot_2", _STOVE), Fact("turnon", "flat_stove_1")),
    ),
    (
        "KITCHEN_SCENE6",
        "put the yellow and white mug in the microwave and close it",
        (Fact("in", "white_yellow_mug_1", "microwave_1_heating_region"), Fact("close", "microwave_1")),
    ),
)
# Fixtures and the basket are put down more precisely than the rest, m.
_REGION_HALF, _PRECISE_HALF = 0.025, 0.01
# Fixtures that LIBERO puts down turned by half a turn.
_TURNED = ("wine_rack_1", "desk_caddy_1")


def _ten(index: int) -> Task:
    scene, language, goal = _TEN[index]
    layout = LAYOUTS[scene]
    places = {}

    def region(key: str, box: Box, yaw: float = 0.0) -> None:
        name = f"{layout.surface}_{key}"
        places[name] = Place(name, layout.surface, box, yaw)

    standing = {**layout.objects, **layout.fixtures}
    for name, (key, x, y) in standing.items():
        half = _PRECISE_HALF if name in layout.fixtures or name == "basket_1" else _REGION_HALF
        region(key, _square(x, y, half), math.pi if name in _TURNED else 0.0)
    for key, (x, y, half) in layout.extra.items():
        region(key, _square(x, y, half))
    put = [Fact("on", name, f"{layout.surface}_{key}") for name, (key, _, _) in standing.items()]
    joints = [Fact(predicate, subject) for predicate, subject in layout.joints]
    return Task(
        "libero_10",
        index,
        language,
        layout.arena,
        tuple(layout.objects),
        tuple(layout.fixtures),
        places,
        (*put, *joints),
        goal,
        scene,
    )


_SUITES = MappingProxyType(
    {
        "libero_spatial": (_spatial, len(_SPATIAL)),
        "libero_object": (_object, len(_OBJECT)),
        "libero_goal": (_goal, len(_GOAL)),
        "libero_10": (_ten, len(_TEN)),
    }
)

SUITES = tuple(_SUITES)
"""The suites in the order of every table."""


@cache
def task(suite: str, index: int) -> Task:
    """Return a task by suite and benchmark index.

    Raises:
        SubstrateError: The suite is none of :data:`SUITES`, or has no such task.
    """
    if suite not in _SUITES:
        raise SubstrateError(
            f"suite={suite!r} is not one of those whose tasks are known here. {did_you_mean(suite, SUITES)}"
        )
    build, count = _SUITES[suite]
    if not 0 <= index < count:
        raise SubstrateError(f"index={index!r} is not a task of {suite}: it has the tasks 0 to {count - 1}.")
    return build(index)


def tasks(suite: str) -> tuple[Task, ...]:
    """Every task of a suite, in the benchmark's order."""
    count = _SUITES[suite][1] if suite in _SUITES else 1
    return tuple(task(suite, index) for index in range(count))
