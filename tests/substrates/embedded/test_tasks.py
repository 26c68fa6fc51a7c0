from __future__ import annotations

import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.tasks.libero_tasks import SUITES, category_of, task, tasks

SPATIAL = [
    "pick up the black bowl between the plate and the ramekin and place it on the plate",
    "pick up the black bowl next to the ramekin and place it on the plate",
    "pick up the black bowl from table center and place it on the plate",
    "pick up the black bowl on the cookie box and place it on the plate",
    "pick up the black bowl in the top drawer of the wooden cabinet and place it on the plate",
    "pick up the black bowl on the ramekin and place it on the plate",
    "pick up the black bowl next to the cookie box and place it on the plate",
    "pick up the black bowl on the stove and place it on the plate",
    "pick up the black bowl next to the plate and place it on the plate",
    "pick up the black bowl on the wooden cabinet and place it on the plate",
]
OBJECT = [
    "pick up the alphabet soup and place it in the basket",
    "pick up the cream cheese and place it in the basket",
    "pick up the salad dressing and place it in the basket",
    "pick up the bbq sauce and place it in the basket",
    "pick up the ketchup and place it in the basket",
    "pick up the tomato sauce and place it in the basket",
    "pick up the butter and place it in the basket",
    "pick up the milk and place it in the basket",
    "pick up the chocolate pudding and place it in the basket",
    "pick up the orange juice and place it in the basket",
]
GOAL = [
    "open the middle drawer of the cabinet",
    "put the bowl on the stove",
    "put the wine bottle on top of the cabinet",
    "open the top drawer and put the bowl inside",
    "put the bowl on top of the cabinet",
    "push the plate to the front of the stove",
    "put the cream cheese in the bowl",
    "turn on the stove",
    "put the bowl on the plate",
    "put the wine bottle on the rack",
]
GOAL_FACTS = [
    ("open", "wooden_cabinet_1_middle_region", None),
    ("on", "akita_black_bowl_1", "flat_stove_1_cook_region"),
    ("on", "wine_bottle_1", "wooden_cabinet_1_top_side"),
    ("in", "akita_black_bowl_1", "wooden_cabinet_1_top_region"),
    ("on", "akita_black_bowl_1", "wooden_cabinet_1_top_side"),
    ("on", "plate_1", "main_table_stove_front_region"),
    ("on", "cream_cheese_1", "akita_black_bowl_1"),
    ("turnon", "flat_stove_1", None),
    ("on", "akita_black_bowl_1", "plate_1"),
    ("on", "wine_bottle_1", "wine_rack_1_top_region"),
]
TEN = [
    "put both the alphabet soup and the tomato sauce in the basket",
    "put both the cream cheese box and the butter in the basket",
    "turn on the stove and put the moka pot on it",
    "put the black bowl in the bottom drawer of the cabinet and close it",
    "put the white mug on the left plate and put the yellow and white mug on the right plate",
    "pick up the book and place it in the back compartment of the caddy",
    "put the white mug on the plate and put the chocolate pudding to the right of the plate",
    "put both the alphabet soup and the cream cheese box in the basket",
    "put both moka pots on the stove",
    "put the yellow and white mug in the microwave and close it",
]
TEN_FACTS = [
    [
        ("in", "alphabet_soup_1", "basket_1_contain_region"),
        ("in", "tomato_sauce_1", "basket_1_contain_region"),
    ],
    [("in", "cream_cheese_1", "basket_1_contain_region"), ("in", "butter_1", "basket_1_contain_region")],
    [("turnon", "flat_stove_1", None), ("on", "moka_pot_1", "flat_stove_1_cook_region")],
    [
        ("close", "white_cabinet_1_bottom_region", None),
        ("in", "akita_black_bowl_1", "white_cabinet_1_bottom_region"),
    ],
    [("on", "porcelain_mug_1", "plate_1"), ("on", "white_yellow_mug_1", "plate_2")],
    [("in", "black_book_1", "desk_caddy_1_back_contain_region")],
    [
        ("on", "porcelain_mug_1", "plate_1"),
        ("on", "chocolate_pudding_1", "living_room_table_plate_right_region"),
    ],
    [
        ("in", "alphabet_soup_1", "basket_1_contain_region"),
        ("in", "cream_cheese_1", "basket_1_contain_region"),
    ],
    [
        ("on", "moka_pot_1", "flat_stove_1_cook_region"),
        ("on", "moka_pot_2", "flat_stove_1_cook_region"),
        ("turnon", "flat_stove_1", None),
    ],
    [("in", "white_yellow_mug_1", "microwave_1_heating_region"), ("close", "microwave_1", None)],
]


def test_instructions_are_the_benchmarks_own_in_its_order() -> None:
    assert [row.language for row in tasks("libero_spatial")] == SPATIAL
    assert [row.language for row in tasks("libero_object")] == OBJECT
    assert [row.language for row in tasks("libero_goal")] == GOAL
    assert [row.language for row in tasks("libero_10")] == TEN


def test_the_name_is_the_stem_of_the_bddl_file() -> None:
    assert task("libero_object", 3).name == "pick_up_the_bbq_sauce_and_place_it_in_the_basket"
    assert task("libero_10", 8).name == "KITCHEN_SCENE8_put_both_moka_pots_on_the_stove"


def test_goals() -> None:
    goals = {
        (fact.predicate, fact.subject, fact.place) for row in tasks("libero_spatial") for fact in row.goal
    }
    assert goals == {("on", "akita_black_bowl_1", "plate_1")}
    for row in tasks("libero_object"):
        (fact,) = row.goal
        wanted = row.language.removeprefix("pick up the ").removesuffix(" and place it in the basket")
        assert (fact.predicate, fact.subject, fact.place) == (
            "in",
            f"{wanted.replace(' ', '_')}_1",
            "basket_1_contain_region",
        )

    found = [[(f.predicate, f.subject, f.place) for f in row.goal] for row in tasks("libero_goal")]
    assert found == [[fact] for fact in GOAL_FACTS]
    assert [[(f.predicate, f.subject, f.place) for f in row.goal] for row in tasks("libero_10")] == TEN_FACTS


@pytest.mark.parametrize("suite", SUITES)
def test_every_instance_has_exactly_one_place_to_start_from(suite: str) -> None:
    for row in tasks(suite):
        placed = [fact.subject for fact in row.start if fact.place is not None]
        assert sorted(placed) == sorted((*row.objects, *row.fixtures))


def test_six_groceries_stand_on_six_different_spots() -> None:
    for row in tasks("libero_object"):
        named = [fact.place for fact in row.start if fact.place is not None]
        spots = {row.places[place].box for place in named if place in row.places}
        assert len(spots) == 7
        assert len({category_of(name) for name in row.objects}) == 7


def test_unknown_suites_and_indices_are_refused_with_advice() -> None:
    with pytest.raises(SubstrateError, match=r"suite='libero_spacial'.*Did you mean 'libero_spatial'"):
        task("libero_spacial", 0)
    with pytest.raises(SubstrateError, match=r"index=10 .* 0 to 9"):
        task("libero_object", 10)
    with pytest.raises(SubstrateError, match="index=-1"):
        task("libero_object", -1)
