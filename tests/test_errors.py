from __future__ import annotations

import difflib

import pytest

from pytest_libero_max.errors import CLOSEST, MOST_NAMED, did_you_mean


def test_a_few_known_words_are_all_named() -> None:
    assert did_you_mean("frok", ["replay", "fork"]) == "Did you mean 'fork'? Known: fork, replay."
    assert did_you_mean("nothing like it", ["replay", "fork"]) == "Known: fork, replay."
    assert did_you_mean("anything", []) == ""


def test_of_many_known_words_the_closest_are_named() -> None:
    many = [f"libero-spatial-t{task:02}-i{init:02}" for task in range(100) for init in range(80)]
    hint = did_you_mean("libero-spatal-t03-i07", many)
    assert hint.startswith("Did you mean 'libero-spatial-t03-i07'? Also close: libero-spatial-t")
    assert hint.endswith(". There are 8000 in all.")
    assert hint.count("libero-spatial") == CLOSEST


def test_of_many_words_that_are_not_close_a_few_are_named() -> None:
    many = [f"word-{number:03}" for number in range(MOST_NAMED + 1)]
    hint = did_you_mean("?", many)
    assert hint == f"There are {len(many)} in all, for example word-000, word-001, word-002, word-003."


def test_a_word_that_is_too_long_to_be_close_is_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    longest = "fork" + 8 * "x"
    assert did_you_mean(longest, ["fork"]) == "Did you mean 'fork'? Known: fork."
    assert not difflib.get_close_matches(f"{longest}x", ["fork"], cutoff=0.5)
    monkeypatch.delattr(difflib, "get_close_matches")
    assert did_you_mean(f"{longest}x", ["fork"]) == "Known: fork."
