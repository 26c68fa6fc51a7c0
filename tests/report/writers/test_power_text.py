from __future__ import annotations

from collections.abc import Mapping

import pytest

from pytest_libero_max.errors import OptionError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.measures import Rows
from pytest_libero_max.report.sections import SECTIONS, Chance, PlayedPairs, ReportSection
from pytest_libero_max.report.writers.power_text import Expectation, chance_of, expectations_of, power_lines
from pytest_libero_max.stats.blocks import Measure
from tests.report.made_up import PROVENANCE, plain, plan, record_of, records_of

POWER = """\
Smallest loss (percentage points) that the exact McNemar test resolves at level 0.05,
by track and power; n/a where even losing every Base success would not be resolved

               Base  gain  smoke 80%  smoke 90%  lite 80%  lite 90%  max 80%  max 90%
overall       80.0%  3.0%      -29.1      -34.5      -3.1      -3.6     -0.8     -1.0
camera_shift  80.0%  3.0%        n/a        n/a     -12.1     -14.5     -2.7     -3.2

Smallest gain that it resolves; n/a where even gaining every Base failure would not be resolved

               Base  loss  smoke 80%  smoke 90%  lite 80%  lite 90%  max 80%  max 90%
overall       80.0%  3.0%        n/a        n/a      +3.1      +3.6     +0.8     +1.0
camera_shift  80.0%  3.0%        n/a        n/a     +12.1     +14.5     +2.7     +3.2

Pairs needed to resolve a change of -5.0 points:
overall                367 at 80% power, 474 at 90% power
camera_shift           367 at 80% power, 474 at 90% power"""


def test_what_the_tracks_resolve() -> None:
    expected = (Expectation("overall", 0.8, 0.03), Expectation("camera_shift", 0.8, 0.03))
    assert "\n".join(power_lines(expected, change=-0.05)) == POWER


def test_an_earlier_run_gives_the_expectations() -> None:
    pairs = plan(per_cell=3)
    report = build_report(records_of(pairs), [], pairs, PROVENANCE)
    expected = expectations_of(report)
    assert f" of {len(pairs)} pairs" in chance_of(report)[1]
    assert [one.name for one in expected] == ["overall", *plain(report)["by"]["event"]]
    assert expected[0].base == plain(report)["overall"]["base_success"]["value"]
    outcomes = plain(report)["overall"]["outcomes"]
    fewer = min(outcomes["change_associated_success"], outcomes["regression"])
    assert fewer / len(pairs) < expected[0].gain < fewer / len(pairs) + 0.08
    perfect = build_report([record_of(pair, True, True) for pair in pairs[::2]], [], pairs[::2], PROVENANCE)
    assert expectations_of(perfect)[0].gain == 0.0  # no pair fails in Base
    failing = build_report([record_of(pair, False, False) for pair in pairs], [], pairs, PROVENANCE)
    assert expectations_of(failing)[0].gain == pytest.approx(1 - 0.05 ** (1 / len(pairs)))
    assert expectations_of(build_report([], [], pairs, PROVENANCE)) == ()


def test_chance_is_that_of_a_section_that_measures_it(monkeypatch: pytest.MonkeyPatch) -> None:
    class Coin(ReportSection):
        def tables(self, played: PlayedPairs) -> dict[str, Rows]:
            return {}

        def chance(self, measures: Mapping[str, Measure]) -> Chance:
            return Chance("a coin", 3, 1, 40)

    pairs = plan()
    report = build_report(records_of(pairs), [], pairs, PROVENANCE)
    monkeypatch.setattr(SECTIONS, "_loaders", {"coin": Coin})
    monkeypatch.setattr(SECTIONS, "_loaded", {})
    most, text = chance_of(report)
    assert "a coin: 3 lost, 1 gained of 40" in text
    assert 3 / 40 < most < 0.2


def test_a_change_beyond_base_success_is_impossible() -> None:
    lines = power_lines((Expectation("overall", 0.1, 0.0),), change=-0.2)
    assert lines[-1].split()[:5] == ["overall", "impossible:", "at", "most", "10.0%"]
    assert lines[-1].endswith("regress")


def test_a_gain_needs_as_many_pairs_as_a_loss_of_the_same_size() -> None:
    expected = (Expectation("overall", 0.5, 0.02),)
    assert power_lines(expected, change=0.1)[-1] == power_lines(expected, change=-0.1)[-1]
    assert "impossible" not in power_lines(expected, change=0.1)[-1]


def test_a_gain_beyond_base_failures_is_impossible() -> None:
    lines = power_lines((Expectation("overall", 0.9, 0.02),), change=0.2)
    assert lines[-1].split()[:5] == ["overall", "impossible:", "at", "most", "10.0%"]
    assert lines[-1].endswith("gain")


def test_a_perfect_policy_can_only_lose() -> None:
    lines = power_lines((Expectation("overall", 1.0, 0.0),))
    assert lines[-1].split()[3:] == ["n/a"] * 6
    assert lines[4].split()[3:] != ["n/a"] * 6


@pytest.mark.parametrize(("base", "gain"), [(0.8, 0.3), (1.2, 0.0), (0.5, -0.1), (float("nan"), 0.0)])
def test_impossible_expectations_are_refused(base: float, gain: float) -> None:
    with pytest.raises(OptionError, match="gain <= 1 - base"):
        Expectation("overall", base, gain)
