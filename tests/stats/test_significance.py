from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.significance import WORDS, Word, holm, mcnemar, word_for


def test_mcnemar_gives_the_published_value() -> None:
    # M. W. Fagerland, S. Lydersen & P. Laake (2013), BMC Medical Research Methodology 13:91, table 1 (airway
    # hyper-responsiveness before and after stem cell transplantation): 1 and 7 discordant, exact p = 0.0703.
    assert 10 ** mcnemar(1, 7) == pytest.approx(0.0703, abs=5e-5)


def test_mcnemar_gives_the_value_r_gives() -> None:
    # binom.test(3, 13)$p.value
    assert 10 ** mcnemar(3, 10) == pytest.approx(0.09228515625, abs=1e-12)


@given(st.integers(0, 300), st.integers(0, 300))
def test_mcnemar_is_the_binomial_test(losses: int, gains: int) -> None:
    result = mcnemar(losses, gains)
    expected = stats.binomtest(losses, losses + gains).pvalue if losses + gains else 1.0
    assert 10**result == pytest.approx(expected, rel=1e-9)
    assert mcnemar(gains, losses) == result


def test_mcnemar_does_not_underflow() -> None:
    result = mcnemar(2205, 147)
    # Counts of one of the paper's policies; the exact tail, summed in rational arithmetic.
    exact = sum(math.comb(2352, k) for k in range(148))
    expected = math.log10(exact) + (1 - 2352) * math.log10(2)
    assert result == pytest.approx(expected, rel=1e-12)
    assert result < -308
    assert 10**result == 0.0


def test_holm_gives_the_textbook_adjustment() -> None:
    # p.adjust(c(0.01, 0.02, 0.03, 0.005), "holm") in R.
    adjusted = holm([math.log10(p) for p in (0.01, 0.02, 0.03, 0.005)])
    assert [10**p for p in adjusted if p is not None] == pytest.approx([0.03, 0.04, 0.04, 0.02])


@given(st.lists(st.none() | st.floats(-400, 0), max_size=12))
def test_holm_only_ever_raises_and_keeps_the_order(values: list[float | None]) -> None:
    adjusted = holm(values)
    pairs = [(p, q) for p, q in zip(values, adjusted, strict=True) if p is not None]
    assert [q for p, q in zip(values, adjusted, strict=True) if p is None] == [None] * (
        len(values) - len(pairs)
    )
    assert all(q is not None and p <= q <= 0 for p, q in pairs)
    ordered = [q for _, q in sorted((p, q) for p, q in pairs if q is not None)]
    assert ordered == sorted(ordered)


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
