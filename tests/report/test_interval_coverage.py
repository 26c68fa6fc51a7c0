from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.report.interval_coverage import bootstrap_coverage, markdown, wilson_coverage
from pytest_libero_max.stats.intervals import mean_change

REPORT = Path(__file__).parents[2] / "reports" / "interval-coverage.md"


def test_the_published_coverage_is_what_the_code_finds() -> None:
    assert REPORT.read_text() == markdown()


def test_wilson_covers_on_average_what_it_says() -> None:
    coverage = [wilson_coverage(30, rate) for rate in np.linspace(0.02, 0.98, 97)]
    assert np.mean(coverage) == pytest.approx(0.95, abs=0.01)
    assert min(coverage) > 0.89


def test_enumeration_and_simulation_agree_on_the_bootstrap() -> None:
    random = np.random.default_rng(3)
    held = []
    for _ in range(1500):
        result = mean_change(random.choice([-1, 0, 1], size=40, p=[0.3, 0.6, 0.1]))
        assert result is not None
        held.append(result.lower <= -0.2 <= result.upper)
    assert bootstrap_coverage(40, 0.3, 0.1) == pytest.approx(np.mean(held), abs=0.025)
