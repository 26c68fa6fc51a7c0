from __future__ import annotations

import re

import pytest

from pytest_libero_max.report.arm_stages import aim_in_words, fact_in_words
from pytest_libero_max.tasks.libero_tasks import SUITES, tasks

GOALS = [
    (task.language, " ".join(fact.words())) for suite in SUITES for task in tasks(suite) for fact in task.goal
]


@pytest.mark.parametrize(("instruction", "fact"), sorted({(words, fact) for words, fact in GOALS}))
def test_no_goal_of_libero_is_written_as_bddl_spells_it(instruction: str, fact: str) -> None:
    for said in (instruction, ""):  # an instruction of somebody else's names nothing of the scene
        words = fact_in_words(fact, said)
        assert re.fullmatch(r"the [a-z ]+ was [a-z ]+", words)
        assert "region" not in words
        assert not {"the the", "turnon", "contain"} & {*words.split(), words}


@pytest.mark.parametrize(
    ("fact", "instruction", "words"),
    [
        (
            "in akita_black_bowl_1 white_cabinet_1_bottom_region",
            "put the black bowl in the bottom drawer of the cabinet and close it",
            "the black bowl was in the bottom drawer of the cabinet",
        ),
        (
            "on plate_1 main_table_stove_front_region",
            "push the plate to the front of the stove",
            "the plate was on the table in front of the stove",
        ),
        ("turnon flat_stove_1", "turn on the stove", "the stove was on"),
        ("open wooden_cabinet_1_middle_region", "", "the middle drawer of the wooden cabinet was open"),
        (
            "in red_book_1 desk_caddy_1_back_contain_region",
            "",
            "the red book was in the back part of the desk caddy",
        ),
        ("in milk_1 basket_1_contain_region", "put milk in the basket", "the milk was in the basket"),
    ],
)
def test_a_fact_is_a_clause_in_the_words_of_the_task(fact: str, instruction: str, words: str) -> None:
    assert fact_in_words(fact, instruction) == words


def test_what_is_no_fact_is_named_all_the_same() -> None:
    assert fact_in_words("plate_1", "").endswith(" for the plate")
    assert aim_in_words("open wooden_cabinet_1_middle_region") == "to open it"
    assert aim_in_words("on a_1 b_1") == "for the goal"
