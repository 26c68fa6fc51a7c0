"""The initial layouts of LIBERO-10's scenes: the places of all things."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

Arena = Literal["tabletop", "floor", "kitchen", "living_room", "study"]
"""The rooms that LIBERO's scenes are in."""


@dataclass(frozen=True)
class Layout:
    """One scene."""

    arena: Arena
    surface: str
    """Surface that everything stands on."""
    objects: Mapping[str, tuple[str, float, float]]
    """For each instance, in the order of their joints, the key of its place and (x, y) in m, world."""
    fixtures: Mapping[str, tuple[str, float, float]] = field(default_factory=dict)
    """Likewise."""
    extra: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    """Places where nothing stands: (x, y) and half the width, m."""
    joints: tuple[tuple[Literal["open", "turnon"], str], ...] = ()
    """Joints that are open or on: predicate and subject."""


LAYOUTS: Mapping[str, Layout] = MappingProxyType(
    {
        "LIVING_ROOM_SCENE1": Layout(
            "living_room",
            "living_room_table",
            {
                "alphabet_soup_1": ("alphabet_soup_init_region", 0.05, -0.10),
                "cream_cheese_1": ("cream_cheese_init_region", -0.15, 0.06),
                "tomato_sauce_1": ("tomato_sauce_init_region", 0.10, -0.20),
                "ketchup_1": ("ketchup_init_region", -0.20, -0.15),
                "basket_1": ("basket_init_region", 0.0, 0.26),
            },
        ),
        "LIVING_ROOM_SCENE2": Layout(
            "living_room",
            "living_room_table",
            {
                "alphabet_soup_1": ("alphabet_soup_init_region", -0.10, -0.15),
                "cream_cheese_1": ("cream_cheese_init_region", 0.10, -0.20),
                "tomato_sauce_1": ("tomato_sauce_init_region", -0.10, 0.05),
                "ketchup_1": ("ketchup_init_region", -0.25, -0.15),
                "orange_juice_1": ("orange_juice_init_region", 0.0, -0.25),
                "milk_1": ("milk_init_region", 0.05, -0.10),
                "butter_1": ("butter_init_region", 0.05, 0.05),
                "basket_1": ("basket_init_region", 0.0, 0.26),
            },
        ),
        "LIVING_ROOM_SCENE5": Layout(
            "living_room",
            "living_room_table",
            {
                "porcelain_mug_1": ("porcelain_mug_init_region", -0.10, -0.15),
                "red_coffee_mug_1": ("red_coffee_mug_init_region", -0.20, 0.0),
                "white_yellow_mug_1": ("white_yellow_mug_init_region", -0.05, 0.10),
                "plate_1": ("plate_left_region", 0.0, -0.30),
                "plate_2": ("plate_right_region", 0.0, 0.30),
            },
        ),
        "LIVING_ROOM_SCENE6": Layout(
            "living_room",
            "living_room_table",
            {
                "porcelain_mug_1": ("porcelain_mug_init_region", -0.10, -0.15),
                "red_coffee_mug_1": ("red_coffee_mug_init_region", -0.20, 0.0),
                "plate_1": ("plate_init_region", 0.15, 0.0),
                "chocolate_pudding_1": ("chocolate_pudding_init_region", -0.05, 0.10),
            },
            extra={"plate_left_region": (0.15, -0.10, 0.05), "plate_right_region": (0.15, 0.10, 0.05)},
        ),
        "KITCHEN_SCENE3": Layout(
            "kitchen",
            "kitchen_table",
            {
                "chefmate_8_frypan_1": ("frypan_init_region", -0.05, -0.25),
                "moka_pot_1": ("moka_pot_init_region", 0.05, 0.0),
            },
            {"flat_stove_1": ("flat_stove_init_region", -0.20, 0.20)},
        ),
        "KITCHEN_SCENE4": Layout(
            "kitchen",
            "kitchen_table",
            {
                "akita_black_bowl_1": ("akita_black_bowl_init_region", 0.03, -0.05),
                "wine_bottle_1": ("wine_bottle_init_region", -0.15, 0.05),
            },
            {
                "white_cabinet_1": ("white_cabinet_init_region", 0.0, 0.30),
                "wine_rack_1": ("wine_rack_init_region", -0.10, -0.30),
            },
            joints=(("open", "white_cabinet_1_bottom_region"),),
        ),
        "KITCHEN_SCENE6": Layout(
            "kitchen",
            "kitchen_table",
            {
                "porcelain_mug_1": ("porcelain_mug_init_region", -0.10, -0.25),
                "white_yellow_mug_1": ("white_yellow_mug_init_region", 0.0, 0.0),
            },
            {"microwave_1": ("microwave_init_region", 0.0, 0.35)},
            extra={"porcelain_mug_front_region": (0.0, -0.25, 0.05)},
            joints=(("open", "microwave_1"),),
        ),
        "KITCHEN_SCENE8": Layout(
            "kitchen",
            "kitchen_table",
            {
                "moka_pot_1": ("moka_pot_right_init_region", -0.05, 0.25),
                "moka_pot_2": ("moka_pot_left_init_region", 0.05, 0.05),
            },
            {"flat_stove_1": ("flat_stove_init_region", -0.20, -0.20)},
            joints=(("turnon", "flat_stove_1"),),
        ),
        "STUDY_SCENE1": Layout(
            "study",
            "study_table",
            {
                "black_book_1": ("black_book_init_region", -0.20, 0.15),
                "white_yellow_mug_1": ("white_yellow_mug_init_region", -0.10, 0.0),
            },
            {"desk_caddy_1": ("desk_caddy_init_region", -0.40, -0.14)},
            extra={"desk_caddy_right_region": (-0.40, 0.15, 0.05)},
        ),
    }
)
"""Layouts by LIBERO-90's name of the scene."""
