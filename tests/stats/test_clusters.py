from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.stats.blocks import IntervalByTask
from pytest_libero_max.stats.clusters import cluster_bootstrap, task_interval
from pytest_libero_max.stats.intervals import clopper_pearson, mean_change
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.ratios import Ratio

RANDOM = np.random.default_rng(7)
VALUES = RANDOM.choice([-1, 0, 1], size=300, p=[0.3, 0.6, 0.1])
SOURCES = np.array(["plus"] * 210 + ["pro"] * 90)


def test_clusters_of_one_case_approach_the_exact_bootstrap() -> None:
    exact = mean_change(VALUES, SOURCES)
    clustered = cluster_bootstrap(VALUES, np.arange(300), strata=SOURCES, pools=SOURCES, replicates=20_000)
    assert exact is not None
    assert clustered is not None
    assert clustered.lower == pytest.approx(exact.lower, abs=2 / 300)
    assert clustered.upper == pytest.approx(exact.upper, abs=2 / 300)


def test_cases_that_move_together_widen_the_interval() -> None:
    tasks = np.repeat(np.arange(20), 15)
    together = np.repeat(RANDOM.choice([-1, 0], size=20), 15)
    alone = cluster_bootstrap(together, np.arange(300))
    clustered = cluster_bootstrap(together, tasks)
    assert alone is not None
    assert clustered is not None
    assert clustered.upper - clustered.lower > 2 * (alone.upper - alone.lower)


def test_two_clusters_have_the_distribution_of_two_coins() -> None:
    # Resampled means are -1, -1/2 and 0 with probabilities 1/4, 1/2 and 1/4.
    interval = cluster_bootstrap([-1, -1, 0, 0], ["a", "a", "b", "b"], confidence=0.4)
    assert interval is not None
    assert (interval.lower, interval.upper) == (-0.5, -0.5)
    wide = cluster_bootstrap([-1, -1, 0, 0], ["a", "a", "b", "b"], confidence=0.9)
    assert wide is not None
    assert (wide.lower, wide.upper) == (-1, 0)


def test_fixed_weights_keep_the_composition_of_sources() -> None:
    # Every task fails in one source only: whatever tasks are drawn, the weighted mean stays.
    tasks = np.concatenate([np.arange(210) % 40, np.arange(90) % 40])
    values = np.where(SOURCES == "plus", -1, 0)
    interval = cluster_bootstrap(values, tasks, pools=SOURCES)
    assert interval is not None
    assert (interval.lower, interval.upper) == pytest.approx((-0.7, -0.7))


def test_the_order_of_cases_and_the_chunks_never_show(monkeypatch: pytest.MonkeyPatch) -> None:
    clusters = np.array([f"task {number}" for number in RANDOM.integers(25, size=300)])
    strata = np.array([f"{int(name[5:]) % 2}" for name in clusters])
    order = RANDOM.permutation(300)
    first = cluster_bootstrap(VALUES, clusters, strata=strata, pools=strata, seed=3)
    again = cluster_bootstrap(
        VALUES[order], clusters[order], strata=strata[order], pools=strata[order], seed=3
    )
    assert first == again
    monkeypatch.setattr("pytest_libero_max.stats.clusters._CHUNK", 1000)
    assert cluster_bootstrap(VALUES, clusters, strata=strata, pools=strata, seed=3) == first
    assert cluster_bootstrap(VALUES, clusters, strata=strata, pools=strata, seed=4) != first


def test_a_pool_missing_from_a_resample_is_left_out_of_it() -> None:
    interval = cluster_bootstrap([-1, 0], ["a", "b"], pools=["plus", "pro"])
    assert interval is not None
    assert (interval.lower, interval.upper) == (-1, 0)


def test_nothing_has_no_interval() -> None:
    assert cluster_bootstrap([], []) is None


def test_the_interval_covers_the_mean_of_clustered_cases() -> None:
    random = np.random.default_rng(11)
    hits = []
    for trial in range(120):
        rates = random.beta(3, 3, size=40)
        values = (random.random((40, 10)) < rates[:, None]).astype(int).ravel()
        interval = cluster_bootstrap(values, np.repeat(np.arange(40), 10), replicates=1000, seed=trial)
        assert interval is not None
        hits.append(interval.lower <= 0.5 <= interval.upper)
    assert 0.9 <= np.mean(hits) <= 0.985


def _task_interval(differences: NDArray[np.int64], tasks: NDArray[np.int64]) -> IntervalByTask:
    losses, gains = int((differences < 0).sum()), int((differences > 0).sum())
    independent = paired_difference(losses, gains, len(differences))
    return task_interval(differences, tasks, independent)


def _undecided(changed: int) -> IntervalByTask:
    return IntervalByTask(tasks=40, effective_tasks=40.0, changed_tasks=changed, lower=None, upper=None)


def test_few_tasks_or_few_changed_ones_cannot_be_decided() -> None:
    tasks = np.repeat(np.arange(40), 5)
    alike = np.zeros(200, dtype=int)
    assert _task_interval(alike, tasks) == _undecided(0)
    rare = np.where(tasks < 14, -1, 0)
    assert _task_interval(rare, tasks) == _undecided(14)
    few = np.repeat([-1, 0], 100)
    found = _task_interval(few, np.arange(200) % 29)
    assert (found.tasks, found.changed_tasks, found.interval) == (29, 29, None)
    assert _task_interval(few, np.arange(200) % 40).interval is not None


def test_tasks_of_unequal_size_count_for_less() -> None:
    sizes = np.concatenate([np.full(5, 100), np.full(35, 4)])
    tasks = np.repeat(np.arange(40), sizes)
    found = _task_interval(np.where(np.arange(len(tasks)) % 2, -1, 0), tasks)
    assert found.effective_tasks == pytest.approx(sizes.sum() ** 2 / (sizes**2).sum())
    assert found.interval is None


def test_rates_and_shares_are_taken_by_task_as_well() -> None:
    random = np.random.default_rng(5)
    tasks = np.repeat(np.arange(40), 20)
    base = random.random(800) < np.repeat(random.beta(2, 2, 40), 20)
    lost = base & (random.random(800) < np.repeat(random.beta(1, 3, 40), 20))
    share = (0.0, 1.0)
    alone = clopper_pearson(Ratio(int(base.sum()), 800))
    rate = task_interval(base, tasks, alone, bounds=share)
    assert rate.interval is not None
    assert alone is not None
    assert 0 <= rate.interval.lower < alone.lower < alone.upper < rate.interval.upper <= 1
    part = clopper_pearson(Ratio(int(lost.sum()), int(base.sum())))
    found = task_interval(lost, tasks, part, of=base, bounds=share)
    assert found.interval is not None
    assert found.interval.lower < lost.sum() / base.sum() < found.interval.upper
    everywhere = task_interval(np.ones(800, dtype=bool), tasks, alone, bounds=share)
    assert (everywhere.changed_tasks, everywhere.interval) == (0, None)


def test_an_interval_by_task_is_never_narrower_than_the_one_of_independent_pairs() -> None:
    tasks = np.repeat(np.arange(40), 5)
    for values in (np.tile([-1, 0, 0, 1, 0], 40), np.where(tasks % 2 == 0, -1, 0), VALUES[:200]):
        alone = paired_difference(int((values < 0).sum()), int((values > 0).sum()), 200)
        interval = _task_interval(values, tasks).interval
        assert alone is not None
        assert interval is not None
        assert interval.lower <= alone.lower
        assert interval.upper >= alone.upper
    together = _task_interval(np.where(tasks % 2 == 0, -1, 0), tasks).interval
    apart = _task_interval(np.where(np.arange(200) % 2 == 0, -1, 0), tasks).interval
    assert together is not None
    assert apart is not None
    assert together.upper - together.lower > 1.5 * (apart.upper - apart.lower)


@pytest.mark.parametrize(("first", "second", "mean"), [(0.4, 1.6, 0.2), (0.2, 9.8, 0.02)])
def test_an_interval_by_task_seldom_misses_the_mean_over_tasks(
    first: float, second: float, mean: float
) -> None:
    random = np.random.default_rng(13)
    missed = 0
    for _ in range(80):
        rates = random.beta(first, second, size=30)
        values = -(random.random((30, 40)) < rates[:, None]).astype(int).ravel()
        interval = _task_interval(values, np.repeat(np.arange(30), 40)).interval
        missed += interval is not None and not interval.lower <= -mean <= interval.upper
    assert missed / 80 <= 0.08


def test_an_interval_of_many_tasks_is_drawn_in_chunks_that_never_show(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tasks = np.arange(300)
    at_once = _task_interval(VALUES, tasks)
    assert at_once.interval is not None
    monkeypatch.setattr("pytest_libero_max.stats.clusters._CHUNK", 100_000)
    assert _task_interval(VALUES, tasks) == at_once
    monkeypatch.undo()
    many = _task_interval(np.tile(VALUES, 2), np.arange(600))
    assert many.tasks == 600
    assert many.interval is not None
