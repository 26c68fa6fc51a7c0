"""Variance components, worked out by hand and by simulation."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_libero_max.lab.sections.nested import variance_components


def test_a_balanced_table_by_hand() -> None:
    """Two tasks of two cases of two plays: mean squares 0.5, 4 and 72."""
    found = variance_components([[0, 1], [2, 3], [6, 7], [8, 9]], ["a", "a", "b", "b"])
    assert found is not None
    assert found.plays == pytest.approx(0.5)
    assert found.cases == pytest.approx((4 - 0.5) / 2)
    assert found.tasks == pytest.approx((72 - 4) / 4)
    assert found.standard_error() == pytest.approx((17 / 2 + 1.75 / 4 + 0.5 / 8) ** 0.5)
    assert found.standard_error(cases=2) == pytest.approx((17 / 2 + 1.75 / 8 + 0.5 / 16) ** 0.5)
    assert found.standard_error(plays=2) == pytest.approx((17 / 2 + 1.75 / 4 + 0.5 / 16) ** 0.5)


def test_estimates_are_unbiased_with_unequal_tasks() -> None:
    draw = np.random.default_rng(0)
    tasks = np.repeat(np.arange(12), [2, 9, 4, 6, 1, 3, 12, 5, 2, 7, 4, 9])
    found = []
    for _ in range(400):
        means = 9 + draw.normal(0, 3, 12)[tasks] + draw.normal(0, 2, len(tasks))
        one = variance_components(means[:, None] + draw.normal(0, 1.5, (len(tasks), 3)), tasks)
        assert one is not None
        found.append((one.tasks, one.cases, one.plays))
    assert np.mean(np.array(found, dtype=float), axis=0) == pytest.approx([9, 4, 2.25], rel=0.06)


def test_what_cannot_be_estimated_is_none() -> None:
    assert variance_components([[1.0], [2.0]], ["a", "b"]) is None
    assert variance_components(np.empty((0, 3)), []) is None
    alone = variance_components([[0, 1], [1, 1]], ["a", "b"])
    assert alone is not None
    assert (alone.tasks, alone.cases, alone.standard_error()) == (None, None, None)
    one_task = variance_components([[0, 1], [1, 1]], ["a", "a"])
    assert one_task is not None
    assert (one_task.tasks, one_task.cases) == (None, 0.0)
