"""Plans before anything is played: how often gates pass, what tracks resolve, and advice on both."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.errors import OptionError
from pytest_libero_max.report import gate_plan
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gate_plan import (
    SIZES,
    advice_lines,
    chance_of_passing,
    useful_sizes,
)
from pytest_libero_max.report.gates import EQUIVALENCE_CONFIDENCE, Gate, meets, parse_gate
from pytest_libero_max.report.measures import Rows
from pytest_libero_max.report.sections import SECTIONS, Chance, PlayedPairs, ReportSection
from pytest_libero_max.report.writers.power_text import Expectation, chance_of, expectations_of, power_lines
from pytest_libero_max.stats.blocks import Measure
from pytest_libero_max.stats.intervals import clopper_pearson
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.power import Chances
from pytest_libero_max.stats.ratios import Ratio
from tests.report.gate_table import GATES, PAGE, TRACKS, row
from tests.report.made_up import PROVENANCE, plain, plan, record_of, records_of

INTERVAL = cache(paired_difference)
"""Two thousand draws have some sixty pairs of losses and gains."""


def _value(gate: Gate, kept: int, lost: int, gained: int, pairs: int) -> float:
    """The quantity of a gate, computed from one set of outcomes."""
    if gate.name in ("regressions", "regressions_vs"):
        return lost
    if gate.name in ("base_sr", "dynamic_sr"):
        ratio = Ratio(kept + (lost if gate.name == "base_sr" else gained), pairs)
        return (ratio.value or 0.0) if gate.end is None else float(getattr(clopper_pearson(ratio), gate.end))
    if gate.name == "equivalent_vs":
        interval = INTERVAL(lost, gained, pairs, EQUIVALENCE_CONFIDENCE)
        assert interval is not None
        return max(-interval.lower, interval.upper)
    return (gained - lost) / pairs if gate.end is None else getattr(INTERVAL(lost, gained, pairs), gate.end)


@pytest.mark.parametrize(
    ("text", "pairs"),
    [
        ("delta >= -15%", 32),
        ("delta < -5%", 100),
        ("delta.lower >= -15%", 100),
        ("delta.lower > -20%", 32),
        ("delta.upper <= 0", 32),
        ("dynamic_sr_vs(old).lower >= -10%", 100),
        ("regressions <= 3", 32),
        ("regressions_vs(old) <= 3", 100),
        ("equivalent_vs(old, 12%)", 100),
        ("base_sr.lower >= 75%", 32),
        ("dynamic_sr >= 80%", 100),
    ],
)
def test_the_plan_is_what_simulated_runs_do(text: str, pairs: int) -> None:
    gate, chances = parse_gate(text), Chances(0.85, 0.06, 0.03)
    draws = np.random.default_rng(7).multinomial(pairs, [0.79, 0.06, 0.03, 0.12], 2000).tolist()
    passes = [meets(gate, _value(gate, kept, lost, gained, pairs)) for kept, lost, gained, _ in draws]
    found = np.mean(passes)
    planned = chance_of_passing(gate, pairs, chances)
    assert planned == pytest.approx(found, abs=4 * np.sqrt(0.25 / 2000))
    if 0.02 < planned < 0.98:
        assert 0 < found < 1


def test_known_probabilities() -> None:
    alike = Chances(0.9, 0.02, 0.02)
    assert chance_of_passing(parse_gate("delta.lower >= -15%"), 32, alike) == pytest.approx(0.688, abs=5e-4)
    flips = Chances(0.9, 0.0106, 0.0106)
    assert chance_of_passing(parse_gate("regressions_vs(old) <= 3"), 800, flips) == pytest.approx(
        0.030, abs=5e-4
    )
    assert chance_of_passing(parse_gate("dynamic_sr_vs(old).lower >= -5%"), 32, Chances(1, 0, 0)) == 0


def test_sizes_of_use_tell_a_loss_from_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gate_plan, "SIZES", SIZES[:7])  # more take seconds
    sizes = useful_sizes(parse_gate("dynamic_sr_vs(old).lower >= -5%"), base=0.9, chance=0.01, loss=0.06)
    assert list(sizes) == [200, 400]
    assert not list(useful_sizes(parse_gate("regressions <= 0"), base=0.9, chance=0.05, loss=0.06))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("delta == 0", "cannot be planned"),
        ("stale_mean <= 2", "cannot be planned"),
        ("trigger_coverage >= 90%", "cannot be planned"),
        ("delta.clustered.lower >= -5%", "give --track"),
    ],
)
def test_what_cannot_be_planned_is_refused(text: str, words: str) -> None:
    with pytest.raises(OptionError, match=words):
        chance_of_passing(parse_gate(text), 32, Chances(0.9, 0.01, 0.01))
    with pytest.raises(OptionError, match="loss <= base"):
        Chances(0.1, 0.2, 0.0)


@pytest.mark.parametrize("track", ["smoke", "lite"])
def test_the_page_has_the_numbers_of_the_plan(track: str) -> None:
    page = PAGE.read_text()
    exact = [gate for gate in GATES if "clustered" not in gate]
    exact = exact[:: 2 if track == "smoke" else 4]  # hundreds of pairs take seconds to plan
    assert [gate for gate in exact if row(gate, track) not in page] == []
    assert page.count("\n| `") == len(GATES) * len(TRACKS)


def test_what_no_number_of_pairs_finds_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gate_plan, "SIZES", SIZES[:5])  # thousands of pairs take long to plan
    lines = advice_lines(0.9, 0.05, 0.002)
    assert [re.findall(r"none|up to \d+", line) for line in lines[-4:-2]] == [["none", "up to 100"]] * 2


def test_power_advises_a_track_and_a_limit(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "pairs", "--base", "0.9", "--change=-0.05"]) == 0
    *_, end, estimate, _, beside = capsys.readouterr().out.splitlines()
    assert end.split("  ")[-1].strip() == "--libero-max-track=lite --libero-max-limit=200"
    assert estimate.split()[:3] == ["delta", ">=", "-2.5%"]
    assert re.findall("base_sr|trigger_coverage", beside) == ["base_sr", "trigger_coverage"]
    assert main(["plan", "pairs", "--base", "0.9", "--change=0.05"]) == 0
    assert "Gates that find" not in capsys.readouterr().out


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
