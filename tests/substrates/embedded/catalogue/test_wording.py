from __future__ import annotations

import re

import pytest

from pytest_libero_max.errors import ManifestError
from pytest_libero_max.substrates.embedded.catalogue.wording import (
    PER_STYLE,
    Step,
    paraphrase,
    rewordings,
    steps_of,
)
from pytest_libero_max.tasks.libero_tasks import SUITES, tasks
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES

LANGUAGES = sorted({task.language for suite in SUITES for task in tasks(suite)})


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_task_has_fifty_rewordings_that_name_what_it_names(language: str) -> None:
    found = rewordings(language)
    assert len(found) == len({words.words for words in found}) == 50
    assert language not in {words.words for words in found}
    assert {style: sum(w.style == style for w in found) for style in PER_STYLE} == PER_STYLE
    for words in found:
        for step in steps_of(language):
            assert step.thing in words.words
            assert step.place.removeprefix("to the front") in words.words


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_word_of_the_variation_leaks_into_the_prompt(language: str) -> None:
    leaks = {"variant", "language", "noise", "difficulty", "libero", "view", "level", "sample", "plus"}
    leaks |= {word for category in PLUS_CATEGORIES for word in category.lower().split()} - set(
        language.split()
    )
    leaks -= {"objects", "light"}
    for words in rewordings(language):
        assert not leaks & set(re.findall(r"[a-z]+", words.words))
        assert not re.search(r"[0-9_]", words.words)


@pytest.mark.parametrize(
    ("language", "steps"),
    [
        (
            "pick up the black bowl on the stove and place it on the plate",
            (Step("move", "the black bowl on the stove", "on the plate"),),
        ),
        (
            "turn on the stove and put the moka pot on it",
            (Step("start", "the stove"), Step("move", "the moka pot", "on the stove")),
        ),
        (
            "put the yellow and white mug in the microwave and close it",
            (Step("move", "the yellow and white mug", "in the microwave"), Step("close", "the microwave")),
        ),
        (
            "put the white mug on the left plate and put the yellow and white mug on the right plate",
            (
                Step("move", "the white mug", "on the left plate"),
                Step("move", "the yellow and white mug", "on the right plate"),
            ),
        ),
        (
            "push the plate to the front of the stove",
            (Step("push", "the plate", "to the front of the stove"),),
        ),
        ("put both moka pots on the stove", (Step("move", "both moka pots", "on the stove"),)),
    ],
)
def test_an_instruction_is_taken_apart(language: str, steps: tuple[Step, ...]) -> None:
    assert steps_of(language) == steps


def test_a_paraphrase_uses_other_verbs_alone() -> None:
    words = paraphrase("put both moka pots on the stove")
    assert "both moka pots" in words
    assert words.endswith("them on the stove")


def test_what_is_not_built_like_liberos_is_refused() -> None:
    with pytest.raises(ManifestError, match="instruction='dance'"):
        steps_of("dance")
