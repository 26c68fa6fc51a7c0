"""Values of options: a selection of pairs has one name everywhere."""

from __future__ import annotations

import pytest

from pytest_libero_max.evaluation.settings import OPTIONS


@pytest.mark.parametrize("name", ["strict", "traces", "film"])
@pytest.mark.parametrize("text", ["regressions", "regression"])
def test_regressions_are_spelt_alike_by_every_option(name: str, text: str) -> None:
    (option,) = (option for option in OPTIONS if option.name == name)
    assert str(option.parse(text)) == "regressions"


@pytest.mark.parametrize("name", ["traces", "film"])
def test_traces_and_films_know_the_same_selections(name: str) -> None:
    (option,) = (option for option in OPTIONS if option.name == name)
    assert [str(option.parse(text)) for text in ("none", "changed", "all")] == ["none", "changed", "all"]
