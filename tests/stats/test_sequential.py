from __future__ import annotations

import math
from fractions import Fraction
from itertools import permutations, product

import numpy as np
import pytest

from pytest_libero_max.stats.sequential import TotalSequence, log_evidence_of_change
from tests.stats.capital import capital


@pytest.mark.parametrize("level", [0.05, 0.2])
def test_the_evidence_of_a_change_misleads_at_most_as_often_as_the_level(level: float) -> None:
    """Exactly, by all ways in which 400 fair coins can fall."""
    chance, misled = {0: 1.0}, 0.0
    for coins in range(1, 401):
        after: dict[int, float] = {}
        for losses, probability in chance.items():
            for more in (0, 1):
                after[losses + more] = after.get(losses + more, 0.0) + probability / 2
        stopped = [k for k in after if log_evidence_of_change(k, coins - k) >= -math.log(level)]
        misled += sum(after.pop(k) for k in stopped)
        chance = after
    assert level / 4 < misled <= level


def test_the_evidence_of_a_change_is_the_ratio_of_likelihoods() -> None:
    for losses, gains in product(range(6), repeat=2):
        n = losses + gains
        exact = Fraction(math.factorial(losses) * math.factorial(gains), math.factorial(n + 1)) * 2**n
        assert math.exp(log_evidence_of_change(losses, gains)) == pytest.approx(float(exact))


def test_evidence_of_a_fixed_set_with_as_many_losses_as_gains_never_grows_on_average() -> None:
    """Twelve discordant cases of which six are losses, in a random order: from every state."""
    for losses, gains in product(range(6), repeat=2):
        rest = 12 - losses - gains
        mean = (6 - losses) / rest * math.exp(log_evidence_of_change(losses + 1, gains)) + (
            6 - gains
        ) / rest * math.exp(log_evidence_of_change(losses, gains + 1))
        assert mean <= math.exp(log_evidence_of_change(losses, gains)) * (1 + 1e-12)


@pytest.mark.parametrize(
    ("numbers", "least"),
    [((1, 1, 1, 1, 0, 0, 0), 0), ((1, 0, 0, 0, 0, 0, 0, 0), 0), ((-1, -1, -1, 0, 0, 1, 1), -1)],
)
@pytest.mark.parametrize("level", [0.2, 0.5])
def test_a_sequence_leaves_out_the_sum_in_at_most_the_level_of_all_orders(
    numbers: tuple[int, ...], least: int, level: float
) -> None:
    orders = sorted(set(permutations(numbers)))
    missed = 0
    for order in orders:
        sequence = TotalSequence(len(order), level, least)
        held = True
        for number in order:
            sequence.add(number)
            held &= sequence.least <= sum(numbers) <= sequence.most
        missed += not held
    assert missed <= level * len(orders)


def test_a_sequence_only_shrinks_and_ends_at_the_sum() -> None:
    rng = np.random.default_rng(5)
    for numbers in (rng.integers(-1, 2, 60), rng.integers(0, 2, 60), np.ones(60, int), np.zeros(60, int)):
        least = int(min(numbers.min(), 0))
        sequence = TotalSequence(60, 0.05, least)
        before = sequence.least, sequence.most
        assert before == (60 * least, 60)
        for number in numbers.tolist():
            sequence.add(number)
            assert before[0] <= sequence.least <= sequence.most <= before[1]
            before = sequence.least, sequence.most
        assert before == (numbers.sum(), numbers.sum())


def test_a_sequence_is_the_sums_whose_capital_stayed_low() -> None:
    """Against the capital of each single sum, computed over all pairs at once, for both sides."""
    rng = np.random.default_rng(6)
    numbers = rng.permutation(np.repeat([-1, 0, 1], [9, 40, 3]))
    sequence = TotalSequence(52, 0.1, -1)
    for number in numbers[:20].tolist():
        sequence.add(number)
    seen, left = int(numbers[:20].sum()), 32
    low = {
        side: [
            total
            for total in range(-52, 53)
            if capital(side * numbers[None], total, -1)[0, :20].max() < 2 / 0.1
            and -left <= total - side * seen <= left
        ]
        for side in (1, -1)
    }
    assert (sequence.least, sequence.most) == (min(low[1]), -min(low[-1]))


def test_the_capital_is_the_mean_of_products_of_bets() -> None:
    numbers = np.array([[1, 0, 1, 1, 0]])
    total, found = 2, [Fraction(1)] * 20
    for place, number in enumerate(numbers[0].tolist()):
        rest, left = total - int(numbers[0, :place].sum()), 5 - place
        if number > rest:
            assert capital(numbers, total)[0, place] == math.inf
            break
        for bet in range(20):
            share = Fraction(2 * bet + 1, 40)
            found[bet] *= 1 + share * (Fraction(number * left, rest) - 1) if rest else 1
        assert capital(numbers, total)[0, place] == pytest.approx(float(sum(found) / 20))
