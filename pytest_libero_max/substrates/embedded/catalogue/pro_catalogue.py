"""The catalogue of LIBERO-PRO: ten categories, one variation of each of the forty tasks, ten initial states.

Recast objects, exchanged places and other tasks are LIBERO-PRO's own. Where its variation would do nothing,
or leave nothing to do, another is chosen, and the entry says so. A parameter that LIBERO-PRO does not give
has a note that says why. The initial states are those of the unmodified task.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes.camera import PlaceCamera
from pytest_libero_max.changes.instruction import SetInstruction, SetTask
from pytest_libero_max.changes.light import SetLamps, SetLighting
from pytest_libero_max.changes.material import CoverEntity
from pytest_libero_max.changes.pixels import SetGlare, SetSensorCorruption
from pytest_libero_max.changes.poses import PutObject
from pytest_libero_max.substrates.embedded.arenas import ARENAS
from pytest_libero_max.substrates.embedded.catalogue import swaps, wording
from pytest_libero_max.substrates.embedded.catalogue.floorplan import floorplan
from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.substrates.embedded.objects.restyled import SMALL, style_of
from pytest_libero_max.substrates.embedded.surfaces import shown
from pytest_libero_max.substrates.variation import Variation, seed
from pytest_libero_max.tasks.libero_tasks import SUITES, Task, category_of
from pytest_libero_max.tasks.libero_tasks import task as task_of
from pytest_libero_max.tasks.sources import PRO_CATEGORIES
from pytest_libero_max.worlds.contract import Goal

CAMERA = "agentview"


class _Row(NamedTuple):
    """Parameters of LIBERO-PRO's variations of one task."""

    recast: Mapping[str, str]
    """New category by category, object by object."""
    places: Mapping[str, str]
    """Instance by the instance whose place it takes."""
    words: str
    """Instruction of the other task."""
    goal: Goal
    """Its goal."""
    target: str
    """Instance that is occluded, resized or started elsewhere."""
    covered: tuple[str, ...]
    """Instances that are covered with another material."""


_BOWL, _BOWL_2, _PLATE = "akita_black_bowl_1", "akita_black_bowl_2", "plate_1"
_CABINET, _STOVE, _RACK = "wooden_cabinet_1", "flat_stove_1", "wine_rack_1"
_BOTTLE, _CHEESE, _BASKET = "wine_bottle_1", "cream_cheese_1", "basket_1"
_COOK, _TOP = "flat_stove_1_cook_region", "wooden_cabinet_1_top_side"
_RAMEKIN, _COOKIES = "glazed_rim_porcelain_ramekin_1", "cookies_1"
_SOUP, _TOMATO, _BUTTER = "alphabet_soup_1", "tomato_sauce_1", "butter_1"
_KETCHUP, _JUICE, _PUDDING = "ketchup_1", "orange_juice_1", "chocolate_pudding_1"
_WHITE, _RED, _YELLOW = "porcelain_mug_1", "red_coffee_mug_1", "white_yellow_mug_1"
_POT, _POT_2, _PAN = "moka_pot_1", "moka_pot_2", "chefmate_8_frypan_1"
_IN_BASKET = "basket_1_contain_region"


def _both(one: str, other: str) -> Mapping[str, str]:
    return MappingProxyType({one: other, other: one})


# The words for the place of the second bowl, and what changes places.
_SPATIAL: tuple[tuple[str, Mapping[str, str]], ...] = (
    ("next to the ramekin", _both(_COOKIES, _PLATE)),
    ("next to the cookie box", _both(_BOWL_2, _PLATE)),
    ("next to the plate", _both(_COOKIES, _PLATE)),
    ("on the wooden cabinet", _both(_CABINET, _PLATE)),
    ("on the wooden cabinet", _both(_COOKIES, _PLATE)),
    ("on the cookie box", _both(_BOWL_2, _PLATE)),
    ("on the stove", _both(_BOWL_2, _PLATE)),
    ("on the wooden cabinet", _both(_RAMEKIN, _PLATE)),
    ("next to the ramekin", _both(_COOKIES, _PLATE)),
    ("on the stove", _both(_RAMEKIN, _PLATE)),
)

# The relative that takes the target's part, what it changes places with, and the other task's target.
_OBJECT: tuple[tuple[str | None, str, str], ...] = (
    ("bigger_alphabet_soup", _BUTTER, "cream_cheese"),
    ("red_cream_cheese", _SOUP, "alphabet_soup"),
    ("red_salad_dressing", _TOMATO, "tomato_sauce"),
    ("green_bbq_sauce", _PUDDING, "ketchup"),
    ("blue_ketchup", _CHEESE, "milk"),
    ("yellow_tomato_sauce", "milk_1", "bbq_sauce"),
    ("green_butter", _TOMATO, "orange_juice"),
    ("yellow_milk", _CHEESE, "butter"),
    ("green_chocolate_pudding", _KETCHUP, "salad_dressing"),
    (None, _PUDDING, "chocolate_pudding"),
)

_BIG, _YELLOW_CABINET = "bigger_akita_black_bowl", "yellow_cabinet"
_GOAL: tuple[_Row, ...] = (
    # Only fixtures change places; which ones is not published.
    _Row(
        MappingProxyType({"wooden_cabinet": _YELLOW_CABINET}),
        _both(_CABINET, _RACK),
        "open the bottom drawer of the cabinet",
        (("open", "wooden_cabinet_1_bottom_region"),),
        _CABINET,
        (_CABINET,),
    ),
    _Row(
        MappingProxyType({"akita_black_bowl": _BIG, "flat_stove": "yellow_stove"}),
        _both(_BOWL, _BOTTLE),
        "put the plate on the stove",
        (("on", _PLATE, _COOK),),
        _BOWL,
        (_STOVE,),
    ),
    _Row(
        MappingProxyType({"wine_bottle": "white_bottle", "wooden_cabinet": _YELLOW_CABINET}),
        _both(_BOWL, _BOTTLE),
        "put the wine bottle in the bowl",
        (("on", _BOTTLE, _BOWL),),
        _BOTTLE,
        (_CABINET,),
    ),
    _Row(
        MappingProxyType({"akita_black_bowl": _BIG, "wooden_cabinet": _YELLOW_CABINET}),
        _both(_BOWL, _CHEESE),
        "open the top drawer and put the cream cheese inside",
        (("in", _CHEESE, "wooden_cabinet_1_top_region"),),
        _BOWL,
        (_CABINET,),
    ),
    _Row(
        MappingProxyType({"akita_black_bowl": _BIG, "wooden_cabinet": _YELLOW_CABINET}),
        _both(_BOWL, _CHEESE),
        "put the plate on top of the cabinet",
        (("on", _PLATE, _TOP),),
        _BOWL,
        (_CABINET,),
    ),
    _Row(
        MappingProxyType({"plate": "yellow_plate"}),
        _both(_PLATE, _BOTTLE),
        "push the cream cheese to the front of the stove",
        (("on", _CHEESE, "main_table_stove_front_region"),),
        _PLATE,
        (_PLATE,),
    ),
    _Row(
        MappingProxyType({"akita_black_bowl": _BIG, "cream_cheese": "red_cream_cheese"}),
        MappingProxyType({_STOVE: _CHEESE, _CHEESE: _STOVE, _BOWL: _BOTTLE, _BOTTLE: _BOWL}),
        "put the wine bottle in the bowl",
        (("on", _BOTTLE, _BOWL),),
        _CHEESE,
        (_BOWL,),
    ),
    # LIBERO-PRO's other task is to turn the stove off, which it is from the start.
    _Row(
        MappingProxyType({"flat_stove": "yellow_stove"}),
        _both(_STOVE, _CHEESE),
        "put the cream cheese on the stove",
        (("on", _CHEESE, _COOK),),
        _STOVE,
        (_STOVE,),
    ),
    _Row(
        MappingProxyType({"akita_black_bowl": _BIG, "plate": "yellow_plate"}),
        MappingProxyType({_BOWL: _CHEESE, _CHEESE: _BOWL, _PLATE: _BOTTLE, _BOTTLE: _PLATE}),
        "put the wine bottle on the plate",
        (("on", _BOTTLE, _PLATE),),
        _BOWL,
        (_PLATE,),
    ),
    _Row(
        MappingProxyType({"wine_bottle": "white_bottle", "wine_rack": "brown_rack"}),
        _both(_BOWL, _BOTTLE),
        "put the cream cheese on the rack",
        (("on", _CHEESE, "wine_rack_1_top_region"),),
        _BOTTLE,
        (_RACK,),
    ),
)

_TEN: tuple[_Row, ...] = (
    _Row(
        MappingProxyType(
            {
                "alphabet_soup": "bigger_alphabet_soup",
                "basket": "red_basket",
                "tomato_sauce": "yellow_tomato_sauce",
            }
        ),
        MappingProxyType({_SOUP: _KETCHUP, _KETCHUP: _SOUP, _JUICE: _TOMATO, _TOMATO: _JUICE}),
        "put both the cream cheese and the tomato sauce in the basket",
        (("in", _CHEESE, _IN_BASKET), ("in", _TOMATO, _IN_BASKET)),
        _SOUP,
        (_BASKET,),
    ),
    _Row(
        MappingProxyType(
            {"basket": "red_basket", "butter": "green_butter", "cream_cheese": "red_cream_cheese"}
        ),
        MappingProxyType({_BUTTER: _TOMATO, _TOMATO: _BUTTER, _CHEESE: _JUICE, _JUICE: _CHEESE}),
        "put both the alphabet soup and the butter in the basket",
        (("in", _SOUP, _IN_BASKET), ("in", _BUTTER, _IN_BASKET)),
        _CHEESE,
        (_BASKET,),
    ),
    _Row(
        MappingProxyType({"flat_stove": "yellow_stove", "moka_pot": "yellow_moka_pot"}),
        _both(_PAN, _POT),
        "turn on the stove and put the pan on it",
        (("turnon", _STOVE), ("on", _PAN, _COOK)),
        _POT,
        (_STOVE,),
    ),
    _Row(
        MappingProxyType({"akita_black_bowl": "black_bowl", "white_cabinet": "wooden_cabinet"}),
        _both(_BOWL, _BOTTLE),
        "put the bottle in the bottom drawer of the cabinet and close it",
        (
            ("close", "white_cabinet_1_bottom_region"),
            ("in", _BOTTLE, "white_cabinet_1_bottom_region"),
        ),
        _BOWL,
        ("white_cabinet_1",),
    ),
    _Row(
        MappingProxyType({"plate": "yellow_plate"}),
        _both(_RED, _YELLOW),
        "put the yellow and white mug on the left plate and put the white mug on the right plate",
        (("on", _YELLOW, "plate_1"), ("on", _WHITE, "plate_2")),
        _PLATE,
        ("plate_1", "plate_2"),
    ),
    # LIBERO-PRO puts a bowl in the book's place, which the caddy has no room for.
    _Row(
        MappingProxyType({"black_book": "yellow_book"}),
        _both("black_book_1", _YELLOW),
        "pick up the cup and place it in the back compartment of the caddy",
        (("in", _YELLOW, "desk_caddy_1_back_contain_region"),),
        "black_book_1",
        ("desk_caddy_1",),
    ),
    _Row(
        MappingProxyType(
            {
                "chocolate_pudding": "green_chocolate_pudding",
                "plate": "yellow_plate",
                "porcelain_mug": "white_yellow_mug",
            }
        ),
        _both(_PUDDING, _RED),
        "put the red mug on the plate and put the chocolate pudding to the right of the plate",
        (("on", _RED, _PLATE), ("on", _PUDDING, "living_room_table_plate_right_region")),
        _PLATE,
        (_PLATE,),
    ),
    _Row(
        MappingProxyType(
            {
                "alphabet_soup": "bigger_alphabet_soup",
                "basket": "red_basket",
                "cream_cheese": "red_cream_cheese",
            }
        ),
        MappingProxyType({_SOUP: _KETCHUP, _KETCHUP: _SOUP, _CHEESE: _TOMATO, _TOMATO: _CHEESE}),
        "put both the ketchup and the cream cheese box in the basket",
        (("in", _KETCHUP, _IN_BASKET), ("in", _CHEESE, _IN_BASKET)),
        _SOUP,
        (_BASKET,),
    ),
    _Row(
        MappingProxyType({"moka_pot": "yellow_moka_pot"}),
        _both(_POT_2, _STOVE),
        "put the left moka pot on the stove",
        (("on", _POT, _COOK), ("turnon", _STOVE)),
        _POT,
        (_STOVE,),
    ),
    _Row(
        MappingProxyType({"white_yellow_mug": "red_coffee_mug"}),
        _both(_WHITE, "microwave_1"),
        "put the white mug in the microwave and close it",
        (("in", _WHITE, "microwave_1_heating_region"), ("close", "microwave_1")),
        _YELLOW,
        ("microwave_1",),
    ),
)

_VIEW_POSITION = (0.48, 0.24, 0.72)
_VIEW_AIM = (-0.05, 0.02, 0.02)
"""LIBERO-PRO's camera position above the table's top, in every room above its own surface; it is aimed at the
middle of the workspace, which LIBERO-PRO's own orientation leaves out of the picture."""

_COVER = MappingProxyType(
    {
        "tabletop": "wood_oak",
        "kitchen": "wood_ash",
        "living_room": "wood_ebony",
        "study": "wood_cherry",
        "floor": "concrete",
    }
)
"""Surface that looks like the work surface, by room."""

_RESHAPED = MappingProxyType({("libero_spatial", 5): "bigger_akita_black_bowl"})
"""Exceptions, for which the small relative will not do: a small bowl sinks into the ramekin up to its rim."""

ANOTHER_GOAL: Mapping[tuple[str, str, int], str] = MappingProxyType(
    {
        ("task", "libero_goal", 7): "to turn the stove off, which it is from the start",
    }
)
"""Goals of LIBERO-PRO that differ from those of the variations here, by category, suite and task."""

_LEVELS = (0.020, 0.16, 0.010)
_BRIGHTNESS, _NOISE_STD = 0.68, 12.0
_GLARE = SetGlare(0.85, 0.72, 0.74, 0.30)
"""LIBERO-PRO announces glare and has none; this one leaves the middle of the picture readable."""


def _row(task: Task) -> _Row:
    if task.suite == "libero_spatial":
        words, places = _SPATIAL[task.index]
        return _Row(
            MappingProxyType({"akita_black_bowl": "black_bowl", "plate": "yellow_plate"}),
            places,
            f"pick up the black bowl {words} and place it on the plate",
            (("on", _BOWL_2, _PLATE),),
            _BOWL,
            (_PLATE,),
        )
    if task.suite == "libero_object":
        recast, other, target = _OBJECT[task.index]
        own = category_of(task.objects[0])
        return _Row(
            MappingProxyType({"basket": "red_basket", **({} if recast is None else {own: recast})}),
            _both(task.objects[0], other),
            f"pick up the {target.replace('_', ' ')} and place it in the basket",
            (("in", f"{target}_1", _IN_BASKET),),
            task.objects[0],
            (_BASKET,),
        )
    return {"libero_goal": _GOAL, "libero_10": _TEN}[task.suite][task.index]


Parts = tuple[str, Json, tuple[Json, ...]]
"""Kind, scene and changes."""


def _semantic(task: Task) -> Parts:
    words = wording.paraphrase(task.language)
    return "paraphrase", {}, (SetInstruction(words, "synonyms").to_dict(),)


def _object(task: Task) -> Parts:
    recast, changes = [], []
    plan = floorplan(task.suite, task.index)
    for name in (*task.objects, *task.fixtures):
        kind = category_of(name)
        if kind in _row(task).recast:
            new = _row(task).recast[kind]
            instance = new + name[len(kind) :]
            recast.append([name, instance, new])
            style = style_of(new)
            if name in task.objects and (style is None or style.scale != (1.0, 1.0, 1.0)):
                changes.append(_settled(plan.carried.get(name, plan.arena.surface), instance))
    return "recast", {"recast": recast}, tuple(changes)


def _settled(onto: str, name: str) -> Json:
    """Put an object of another size down where it is, since it rests at another height."""
    return PutObject(name, onto, (0.0, 0.0), name).to_dict()


def _position(task: Task) -> Parts:
    return "exchange", {}, swaps.exchanged(task, _row(task).places)


def _task(task: Task) -> Parts:
    row = _row(task)
    return "other task", {}, (SetTask(row.words, row.goal).to_dict(),)


def _glare(task: Task) -> Parts:
    changes = (
        SetLamps(levels=_LEVELS),
        SetLighting(1.0, _BRIGHTNESS),
        _GLARE,
        SetSensorCorruption(_NOISE_STD, 0.0, seed("pro", task.name, "noise")),
    )
    return "dark, glare, noise", {}, tuple(change.to_dict() for change in changes)


def _view(task: Task) -> Parts:
    arena = ARENAS[task.arena]
    x, y, z = _VIEW_POSITION
    position = (x, y, round(arena.top_z + z, 6))
    aim = (_VIEW_AIM[0], _VIEW_AIM[1], round(arena.top_z + _VIEW_AIM[2], 6))
    return "placed", {}, (PlaceCamera.looking_at(CAMERA, position, aim).to_dict(),)


def _texture(task: Task) -> Parts:
    surface = _COVER[task.arena]
    covers = (CoverEntity(name, (1.0, 1.0, 1.0), shown(surface)).to_dict() for name in _row(task).covered)
    return "covered", {"surfaces": [surface]}, tuple(covers)


def _occlusion(task: Task) -> Parts:
    scene = {"extras": [[swaps.OCCLUDER, swaps.OCCLUDER_CATEGORY]]}
    return "occluder", scene, swaps.occluded(task, _row(task).target)


def _shape(task: Task) -> Parts:
    name = _row(task).target
    plan = floorplan(task.suite, task.index)
    kind = _RESHAPED.get((task.suite, task.index), SMALL + category_of(name))
    changes: tuple[Json, ...] = ()
    if not category(category_of(name)).fixture:
        changes = (_settled(plan.carried.get(name, plan.arena.surface), name),)
    return "resized", {"recast": [[name, name, kind]]}, changes


def _pose(task: Task) -> Parts:
    return "elsewhere", {}, swaps.started_elsewhere(task, _row(task).target)


_MAKERS: Mapping[str, Callable[[Task], Parts]] = MappingProxyType(
    {
        "semantic": _semantic,
        "object": _object,
        "position": _position,
        "task": _task,
        "visual_noise_glare": _glare,
        "camera_view_angle": _view,
        "object_texture": _texture,
        "view_occlusion": _occlusion,
        "object_shape": _shape,
        "initial_pose_position_angle": _pose,
    }
)


@cache
def pro_suite(category: str, suite: str) -> tuple[Variation, ...]:
    """Return the ten variations of a category and a suite, in the order of its tasks.

    Raises:
        SubstrateError: The suite does not exist.
    """
    variations = []
    for index in range(10):
        task = task_of(suite, index)
        kind, scene, changes = _MAKERS[category](task)
        variations.append(
            Variation("pro", suite, index, index, task.name, category, kind, None, scene, changes)
        )
    return tuple(variations)


def pro_variations() -> tuple[Variation, ...]:
    """All 400, by category, suite and task."""
    return tuple(
        variation
        for category in PRO_CATEGORIES
        for suite in SUITES
        for variation in pro_suite(category, suite)
    )
