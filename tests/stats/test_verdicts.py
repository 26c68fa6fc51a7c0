"""Words for differences, against the definitions and against paired-eval where it is installed."""

from __future__ import annotations

import pytest

from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.significance import WORDS, Word, mcnemar, word_for


def word(losses: int, gains: int, pairs: int, **options: float) -> Word:
    interval = paired_difference(losses, gains, pairs)
    assert interval is not None
    return word_for(mcnemar(losses, gains), interval, losses + gains, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("losses", "gains", "pairs", "expected"),
    [
        (30, 5, 800, "significant"),
        (6, 0, 32, "significant"),
        (5, 0, 32, "powerless"),  # all five on one side have p = 0.0625
        (0, 0, 32, "powerless"),
        (0, 0, 800, "bounded null"),
        (5, 3, 800, "bounded null"),
        (10, 6, 100, "uninformative"),
        (3, 3, 32, "uninformative"),  # six on one side would have p = 0.03
    ],
)
def test_each_word_has_its_case(losses: int, gains: int, pairs: int, expected: Word) -> None:
    assert word(losses, gains, pairs) == expected
    assert word(gains, losses, pairs) == expected
    assert expected in WORDS


def test_a_bounded_null_has_a_margin_and_a_test_of_many_needs_more() -> None:
    assert word(5, 3, 800, margin=0.01) == "uninformative"
    assert (word(4, 3, 32), word(4, 3, 32, comparisons=4)) == ("uninformative", "powerless")
    assert word(6, 0, 32, level=0.03) == "powerless"


@pytest.mark.parametrize(("losses", "gains", "pairs"), [(9, 0, 12), (2, 1, 12), (5, 4, 40), (3, 0, 40)])
def test_paired_eval_says_as_much(losses: int, gains: int, pairs: int) -> None:
    """It calls both kinds of null a null, and gives the least p-value that the differing pairs can reach."""
    reason = "needs paired-eval: pip install -r .ci/peers.txt"
    paired_eval = pytest.importorskip("paired_eval", reason=reason)
    compared = {
        "p_value": 10 ** mcnemar(losses, gains),
        "mean_diff": (gains - losses) / pairs,
        "diff_ci": (-1.0, 1.0),
        "n": pairs,
    }
    found = paired_eval.interpret(compared, floor_n=losses + gains, lang="en")
    assert (found["verdict"] == "significant") == (word(losses, gains, pairs) == "significant")
    powerless = found["verdict"] == "null" and found["p_floor"] >= 0.05
    assert powerless == (word(losses, gains, pairs) == "powerless")
