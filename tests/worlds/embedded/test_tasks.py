from __future__ import annotations

import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.embedded.tasks import SUITES, category_of, task, tasks

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


def test_instructions_are_the_benchmarks_own_in_its_order():
    assert [row.language for row in tasks("libero_spatial")] == SPATIAL
    assert [row.language for row in tasks("libero_object")] == OBJECT
    assert [row.language for row in tasks("libero_goal")] == GOAL


def test_the_name_is_the_stem_of_the_bddl_file():
    assert task("libero_object", 3).name == "pick_up_the_bbq_sauce_and_place_it_in_the_basket"


def test_goals():
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


@pytest.mark.parametrize("suite", SUITES)
def test_every_instance_has_exactly_one_place_to_start_from(suite):
    for row in tasks(suite):
        placed = [fact.subject for fact in row.start if fact.place is not None]
        assert sorted(placed) == sorted((*row.objects, *row.fixtures))


def test_six_groceries_stand_on_six_different_spots():
    for row in tasks("libero_object"):
        spots = {row.places[fact.place].box for fact in row.start if fact.place in row.places}
        assert len(spots) == 7
        assert len({category_of(name) for name in row.objects}) == 7


def test_unknown_suites_and_indices_are_refused_with_advice():
    with pytest.raises(SubstrateError, match=r"suite='libero_spacial'.*Did you mean 'libero_spatial'"):
        task("libero_spacial", 0)
    with pytest.raises(SubstrateError, match=r"index=10 .* 0 to 9"):
        task("libero_object", 10)
    with pytest.raises(SubstrateError, match="index=-1"):
        task("libero_object", -1)
