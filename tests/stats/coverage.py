"""How often intervals hold the truth: probabilities over all results that a true effect can have.

A true effect is the probability of a loss (1, 0) and that of a gain (0, 1); the pairs are independent. Unless
said otherwise the coverage is summed over every result, up to results that together have a probability below
1e-11.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from pytest_libero_max.stats.clusters import task_interval
from pytest_libero_max.stats.intervals import Interval, clopper_pearson, mean_change
from pytest_libero_max.stats.paired_difference import Bounds, FloatArray, exact, paired_difference
from pytest_libero_max.stats.ratios import Ratio
from tests.stats.other_intervals import agresti_min, exact_holds, newcombe, tango, tango_score
from tests.stats.unconditional import tables, tail_probabilities

Counts = NDArray[np.int64]
Method = Callable[[int, float, float], float]
"""Coverage for a number of pairs, P(1, 0) and P(0, 1)."""

DRAWS = 4000
"""Results drawn where going through all of them takes too long; standard error 0.4 points near 93%."""

NEWCOMBE_DRAWS = 200_000
"""The same for an interval that costs next to nothing; standard error at most 0.06 points."""

ALIKE_SUCCESSES = (0.5, 0.95)
"""Shares of successes among the pairs that end alike, on which Newcombe's interval depends."""

UNCONDITIONAL_MOST = 100
"""Pairs up to which the exact unconditional interval is computed."""

_ENUMERATED = 100
_CUT = 1e-13
_Z = 1.959963984540054
_TIE = 1e-9
"""A bound this close to the truth holds it; rounding decides nothing."""


def rate_coverage(n: int, rates: Sequence[float]) -> list[float]:
    """Coverage of the exact interval of ``n`` trials at each rate."""
    counts = np.arange(n + 1)
    found = [clopper_pearson(Ratio(count, n)) for count in counts.tolist()]
    lower, upper = np.array([(one.lower, one.upper) for one in found if one is not None]).T
    return [
        float(stats.binom.pmf(counts, n, rate)[(lower - _TIE <= rate) & (rate <= upper + _TIE)].sum())
        for rate in rates
    ]


def wilson_coverage(n: int, rates: Sequence[float]) -> list[float]:
    """Coverage of the Wilson interval of ``n`` trials at each rate."""
    counts = np.arange(n + 1)
    intervals = [stats.binomtest(count, n).proportion_ci(method="wilson") for count in counts.tolist()]
    return [
        float(stats.binom.pmf(counts, n, rate)[[low <= rate <= high for low, high in intervals]].sum())
        for rate in rates
    ]


TASKS = 40
"""Tasks of a simulated run."""

BASE_RATE = 0.8
"""Base success of the pairs, in every task, where a share of the Base successes is lost."""


@dataclass(frozen=True)
class TaskCell:
    """Simulated runs of :data:`TASKS` tasks, whose interval by task may miss the truth.

    Attributes:
        quantity: What is measured: the paired ``change`` where pairs are lost, the ``rate`` of success, or
            the share of Base successes ``lost``.
        pairs: Mean number of pairs of a task.
        mean: Mean over tasks of the probability of a loss; for a rate, of a success.
        spread: Sum of the parameters of the beta distribution of the tasks' probabilities; small where a loss
            is in few tasks. Infinite where all tasks are alike.
        uneven: Standard deviation of the logarithm of a task's number of pairs; 0 where all are equal.
    """

    quantity: Literal["change", "rate", "lost"]
    pairs: int
    mean: float
    spread: float
    uneven: float = 0.0


def task_misses(cell: TaskCell, runs: int = 400, seed: int = 0) -> tuple[float, float]:
    """Return the shares of runs whose interval by task misses the mean, and that have none."""
    random = np.random.default_rng(seed)
    truth = -cell.mean if cell.quantity == "change" else cell.mean
    missed = undecided = 0
    for _ in range(runs):
        tasks = np.repeat(np.arange(TASKS), _drawn_sizes(random, cell))
        hit = random.random(len(tasks)) < _drawn_rates(random, cell)[tasks]
        if cell.quantity == "change":
            independent = paired_difference(int(hit.sum()), 0, len(hit))
            found = task_interval(-hit.astype(np.int64), tasks, independent)
        else:
            base = random.random(len(hit)) < (BASE_RATE if cell.quantity == "lost" else 1.0)
            independent = clopper_pearson(Ratio(int((hit & base).sum()), int(base.sum())))
            found = task_interval(hit & base, tasks, independent, of=base, bounds=(0.0, 1.0))
        interval = found.interval
        undecided += interval is None
        missed += interval is not None and not interval.lower <= truth <= interval.upper
    return missed / runs, undecided / runs


def _drawn_sizes(random: np.random.Generator, cell: TaskCell) -> Counts:
    """Numbers of pairs of the tasks, at least 1, with the mean of the cell."""
    spread = random.lognormal(-(cell.uneven**2) / 2, cell.uneven, TASKS)
    return np.maximum(1, np.rint(cell.pairs * spread)).astype(np.int64)


def _drawn_rates(random: np.random.Generator, cell: TaskCell) -> FloatArray:
    """Probabilities of the tasks."""
    if np.isinf(cell.spread):
        return np.full(TASKS, cell.mean)
    return random.beta(cell.mean * cell.spread, (1 - cell.mean) * cell.spread, TASKS)


def bootstrap_coverage(n: int, loss: float, gain: float, seed: int = 0) -> float:
    """Coverage of the paper's percentile bootstrap.

    Of all results up to a hundred pairs or without gains, of :data:`DRAWS` seeded ones otherwise.
    """
    losses, gains, mass = _results(n, loss, gain, n <= _ENUMERATED or gain == 0, seed)
    held = [_between(_bootstrap(n, a, b), gain - loss) for a, b in zip(losses, gains, strict=True)]
    return float(mass[np.array(held)].sum())


def tango_coverage(n: int, loss: float, gain: float) -> float:
    """Coverage of Tango's score interval."""
    losses, gains, mass = likely_results(n, loss, gain)
    return float(mass[np.abs(tango_score(gain - loss, losses, gains, n)) <= _Z + _TIE].sum())


def agresti_min_coverage(n: int, loss: float, gain: float) -> float:
    """Coverage of Agresti and Min's interval."""
    losses, gains, mass = likely_results(n, loss, gain)
    return float(mass[_inside(agresti_min(losses, gains, n), gain - loss)].sum())


def newcombe_coverage(n: int, loss: float, gain: float, seed: int = 0) -> float:
    """The lower coverage of Newcombe's interval for the shares in :data:`ALIKE_SUCCESSES`.

    Of all results up to 32 pairs, of :data:`NEWCOMBE_DRAWS` seeded ones beyond.
    """
    found = []
    for share in ALIKE_SUCCESSES:
        alike = 1 - loss - gain
        rates = [loss, gain, alike * share, alike * (1 - share)]
        if n <= 32:
            grid = np.stack(np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
            grid = grid[grid.sum(1) <= n]
            results = np.concatenate([grid, n - grid.sum(1, keepdims=True)], 1)
            mass = stats.multinomial.pmf(results, n, rates)
        else:
            generator = np.random.Generator(np.random.PCG64(seed))
            results = generator.multinomial(n, rates, size=NEWCOMBE_DRAWS)
            mass = np.full(NEWCOMBE_DRAWS, 1 / NEWCOMBE_DRAWS)
        bounds = newcombe(results[:, 0], results[:, 1], n, results[:, 2])
        found.append(float(mass[_inside(bounds, gain - loss)].sum()))
    return min(found)


def unconditional_coverage(n: int, loss: float, gain: float) -> float:
    """Coverage of the exact unconditional interval; for up to :data:`UNCONDITIONAL_MOST` pairs."""
    losses, gains = tables(n)
    high, low = tail_probabilities(n, gain - loss)
    held = (high > 0.025) & (low > 0.025)
    return float(_mass(n, losses, gains, loss, gain)[held].sum())


def exact_coverage(n: int, loss: float, gain: float) -> float:
    """Coverage of the melded exact interval.

    Its bounds rise with the gains among a given number of discordant pairs, so that for each of these numbers
    the results that hold the truth are consecutive, and their ends are found by bisection.
    """
    discordant, share = loss + gain, gain / (loss + gain)
    reach = stats.binom.ppf([_CUT, 1 - _CUT], n, discordant).astype(np.int64)
    m = np.arange(max(0, reach[0]), min(n, reach[1] + 1) + 1)
    truth = gain - loss

    def first(beyond: Callable[[Counts], NDArray[np.bool_]]) -> Counts:
        """For each m, the smallest number of gains with a property that more gains keep; m + 1 without."""
        low, high = np.zeros_like(m), m + 1
        while (low < high).any():
            middle = (low + high) // 2
            yes = np.ones(len(m), dtype=np.bool_)
            open_ = low < high
            yes[open_] = beyond(np.where(open_, middle, 0))[open_]
            low, high = np.where(open_ & ~yes, middle + 1, low), np.where(open_ & yes, middle, high)
        return low

    # The interval lies above the truth from some number of gains on, and below it before another.
    start = first(lambda gains: exact_holds(truth, m - gains, gains, n) | _above(truth, m, gains, n))
    end = first(lambda gains: ~exact_holds(truth, m - gains, gains, n) & _above(truth, m, gains, n))
    held = stats.binom.cdf(end - 1, m, share) - stats.binom.cdf(start - 1, m, share)
    return float((stats.binom.pmf(m, n, discordant) * np.maximum(held, 0)).sum())


def _above(truth: float, m: Counts, gains: Counts, n: int) -> NDArray[np.bool_]:
    """Whether the estimate is above the truth: an interval that does not hold the truth then lies above."""
    above: NDArray[np.bool_] = (2 * gains - m) / n > truth
    return above


def all_bounds(name: str, n: int) -> Bounds:
    """Bounds of a method for all tables of ``n`` pairs, in the order of ``unconditional.tables``."""
    losses, gains = tables(n)
    if name == "bootstrap":
        found = [_bootstrap(n, a, b) for a, b in zip(losses.tolist(), gains.tolist(), strict=True)]
        return np.array([one.lower for one in found]), np.array([one.upper for one in found])
    return {"exact": exact, "tango": tango, "agresti_min": agresti_min}[name](losses, gains, n)


def lowest_coverage(bounds: Bounds, n: int, step: float) -> tuple[float, tuple[float, float]]:
    """The lowest coverage over a lattice of true effects, and where it is.

    The lattice has every P(1, 0) > 0 and P(0, 1) <= P(1, 0) that are multiples of ``step`` and sum to at most
    1, and without gains a P(1, 0) for every tenth of a step. The methods are symmetric in losses and gains.
    """
    losses, gains = tables(n)
    count = round(1 / step)
    truths = [(i * step, j * step) for i in range(1, count + 1) for j in range(min(i, count - i) + 1)]
    truths += [(i * step / 10, 0.0) for i in range(1, 10 * count + 1)]
    lowest, where = 1.0, (0.0, 0.0)
    for loss, gain in truths:
        held = _inside(bounds, gain - loss)
        covered = float(_mass(n, losses, gains, loss, gain)[held].sum())
        if covered < lowest - 1e-12:
            lowest, where = covered, (loss, gain)
    return lowest, where


def expected_width(method: Callable[..., Bounds], n: int, loss: float, gain: float) -> float:
    """Mean width of an interval."""
    losses, gains, mass = likely_results(n, loss, gain)
    lower, upper = method(losses, gains, n)
    return float((mass * (upper - lower)).sum())


def likely_results(n: int, loss: float, gain: float) -> tuple[Counts, Counts, FloatArray]:
    """Losses, gains and probabilities of the results that are not all but impossible."""

    def span(rate: float) -> Counts:
        low, high = stats.binom.ppf([_CUT, 1 - _CUT], n, rate).astype(np.int64)
        return np.arange(max(0, low - 1), min(n, high + 1) + 1)

    losses, gains = (grid.ravel() for grid in np.meshgrid(span(loss), span(gain), indexing="ij"))
    possible = losses + gains <= n
    losses, gains = losses[possible], gains[possible]
    mass = _mass(n, losses, gains, loss, gain)
    likely = mass > _CUT / 1000
    return losses[likely], gains[likely], mass[likely]


def _mass(n: int, losses: Counts, gains: Counts, loss: float, gain: float) -> FloatArray:
    results = np.stack([losses, gains, n - losses - gains], 1)
    mass: FloatArray = stats.multinomial.pmf(results, n, [loss, gain, max(0.0, 1 - loss - gain)])
    return np.nan_to_num(mass)


def _results(
    n: int, loss: float, gain: float, every: bool, seed: int
) -> tuple[list[int], list[int], FloatArray]:
    if every:
        losses, gains, mass = likely_results(n, loss, gain)
        return losses.tolist(), gains.tolist(), mass
    generator = np.random.Generator(np.random.PCG64(seed))
    drawn = generator.multinomial(n, [loss, gain, 1 - loss - gain], size=DRAWS)
    return drawn[:, 0].tolist(), drawn[:, 1].tolist(), np.full(DRAWS, 1 / DRAWS)


@lru_cache(maxsize=100_000)
def _bootstrap(n: int, losses: int, gains: int) -> Interval:
    change = mean_change(np.repeat([-1, 0, 1], [losses, n - losses - gains, gains]))
    assert change is not None
    return Interval(change.lower, change.upper)


def _inside(bounds: Bounds, truth: float) -> NDArray[np.bool_]:
    held: NDArray[np.bool_] = (bounds[0] <= truth + _TIE) & (truth - _TIE <= bounds[1])
    return held


def _between(interval: Interval | None, truth: float) -> bool:
    assert interval is not None
    return interval.lower - _TIE <= truth <= interval.upper + _TIE
