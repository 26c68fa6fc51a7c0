"""Our statistics against independent programs: robostats, betapair and confseq.

The first two come with ``.ci/peers.txt``. confseq is compiled when it is installed, and asks for Matplotlib
and multiprocess, of which its betting needs nothing; both may be left out here.
"""

from __future__ import annotations

import importlib.util
import math
import sys
from itertools import product
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.stats.comparison import best_of
from pytest_libero_max.stats.intervals import clopper_pearson
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.stats.sequential import log_evidence_of_change
from pytest_libero_max.stats.significance import mcnemar
from tests.stats.capital import capital
from tests.stats.other_intervals import tango

TABLES = [(losses, gains, 40) for losses, gains in product(range(0, 13, 3), repeat=2)] + [(30, 5, 800)]

NOT_NEEDED = {"matplotlib": ("matplotlib", "matplotlib.pyplot"), "multiprocess": ("multiprocess",)}
"""What confseq imports and its betting does not use."""


@pytest.fixture(scope="module")
def robostats() -> Any:
    return pytest.importorskip("robostats", reason="needs robostats: pip install -r .ci/peers.txt")


@pytest.fixture(scope="module")
def betapair() -> Any:
    return pytest.importorskip("betapair", reason="needs betapair: pip install -r .ci/peers.txt")


@pytest.fixture
def betting(monkeypatch: pytest.MonkeyPatch) -> Any:
    if importlib.util.find_spec("confseq") is None:
        pytest.skip("needs confseq: pip install confseq")
    for package, modules in NOT_NEEDED.items():
        if importlib.util.find_spec(package) is None:
            for name in modules:
                monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setattr(np, "float_", np.float64, raising=False)  # confseq 0.0.11 was written for NumPy 1
    return importlib.import_module("confseq.betting")


def records(robostats: Any, name: str, successes: list[bool]) -> Any:
    return robostats.RecordSet(
        robostats.EpisodeRecord(policy_id=name, scenario_id=f"{i}", success=success, task_id="task")
        for i, success in enumerate(successes)
    )


def table_of(losses: int, gains: int, pairs: int) -> tuple[list[bool], list[bool]]:
    """Success in Base and in Dynamic; pairs that change neither way succeed in both and in none by turns."""
    rest = pairs - losses - gains
    both = [index % 2 == 0 for index in range(rest)]
    return [True] * losses + [False] * gains + both, [False] * losses + [True] * gains + both


@pytest.mark.parametrize(("losses", "gains", "pairs"), TABLES)
def test_robostats_tests_and_bounds_a_paired_change_as_we_do(
    robostats: Any, losses: int, gains: int, pairs: int
) -> None:
    base, dynamic = table_of(losses, gains, pairs)
    paired = robostats.pair(records(robostats, "dynamic", dynamic), records(robostats, "base", base))
    assert robostats.mcnemar(paired).p_value == pytest.approx(10 ** mcnemar(losses, gains), abs=1e-12)
    lower, upper = (float(end[()]) for end in tango(losses, gains, pairs))
    score = robostats.paired_difference(paired)
    assert (score.lower, score.upper) == pytest.approx((lower, upper), abs=1e-6)
    exact = paired_difference(losses, gains, pairs)
    assert exact is not None
    assert exact.lower <= (gains - losses) / pairs <= exact.upper
    rate = robostats.clopper_pearson(sum(base), pairs)
    ours = clopper_pearson(Ratio(sum(base), pairs))
    assert ours is not None
    assert (rate.lower, rate.upper) == pytest.approx((ours.lower, ours.upper), abs=1e-9)


@pytest.mark.parametrize("worse", [0, 3, 30, 60])
def test_robostats_and_we_leave_the_same_policies_beside_the_best(robostats: Any, worse: int) -> None:
    """Three policies on 100 cases: the last loses some of what the first two, nearly equal, complete."""
    cases = 100
    successes = {
        "first": [index < 90 for index in range(cases)],
        "second": [index < 88 for index in range(cases)],
        "third": [index < 90 - worse for index in range(cases)],
    }
    found = robostats.indistinguishable_set(
        robostats.align(*(records(robostats, name, column) for name, column in successes.items()))
    )
    best = best_of({name: np.array(column) for name, column in successes.items()})
    ours = {best.setting, *best.not_worse}
    assert ours == {found.policy_ids[place] for place in found.members}
    assert ("third" in ours) == (worse < 30)


@pytest.mark.parametrize(("losses", "gains", "pairs"), TABLES)
def test_betapair_weighs_a_change_as_we_do(betapair: Any, losses: int, gains: int, pairs: int) -> None:
    """The evidence under a uniform mixture is the Bayes factor of a chance of a gain other than a half.

    By the density ratio at the null (Savage and Dickey) it is one over the posterior density there.
    """
    ours = math.exp(log_evidence_of_change(losses, gains))
    assert 1 / ours == pytest.approx(betapair.beta_pdf(0.5, gains + 1, losses + 1), rel=1e-9)
    found = betapair.mcnemar(n_improved=gains, n_regressed=losses)
    assert found.bf10_point == pytest.approx(ours, rel=1e-9)


@pytest.mark.parametrize(("least", "kinds"), [(0, (0, 1)), (-1, (-1, 0, 1))])
def test_confseq_bets_as_we_do(betting: Any, least: int, kinds: tuple[int, ...]) -> None:
    """The mean of the twenty bets against several sums, without replacement, after 1 to 30 of 60 numbers."""
    numbers = np.random.default_rng(3).choice(kinds, 60, p=None if least == 0 else (0.2, 0.7, 0.1))
    width, population = 1 - least, len(numbers)
    seen = (numbers[:30] - least) / width
    for total in (numbers.sum() - 3, numbers.sum(), numbers.sum() + 10):
        mean = (total - least * population) / (width * population)
        capitals = [
            betting.betting_mart(
                seen,
                mean,
                lambdas_fn_positive=lambda x, m, bet=bet: bet / betting.mu_t(x, m, population),
                N=population,
                theta=1,
                trunc_scale=1,
            )
            for bet in (np.arange(20) + 0.5) / 20
        ]
        ours = capital(numbers[None], int(total), least)[0, :30]
        assert ours == pytest.approx(np.mean(capitals, axis=0), rel=1e-9)
