from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from pytest_libero_max.errors import OptionError
from pytest_libero_max.report import gate_plan
from pytest_libero_max.report.gate_plan import SIZES, chance_of_passing, useful_sizes
from pytest_libero_max.report.gates import EQUIVALENCE_CONFIDENCE, Gate, meets, parse_gate
from pytest_libero_max.stats.gate_power import Chances
from pytest_libero_max.stats.intervals import clopper_pearson
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.ratios import Ratio
from tests.report.gate_table import GATES, PAGE, TRACKS, row

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


@pytest.mark.parametrize("pairs", [32, 100])
@pytest.mark.parametrize(
    "text",
    [
        "delta >= -15%",
        "delta < -5%",
        "delta.lower >= -15%",
        "delta.lower > -20%",
        "delta.upper <= 0",
        "dynamic_sr_vs(old).lower >= -10%",
        "regressions <= 3",
        "regressions_vs(old) <= 3",
        "equivalent_vs(old, 12%)",
        "base_sr.lower >= 75%",
        "dynamic_sr >= 80%",
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
    monkeypatch.setattr(gate_plan, "SIZES", [size for size in SIZES if size <= 1600])  # more take seconds
    sizes = useful_sizes(parse_gate("dynamic_sr_vs(old).lower >= -5%"), base=0.9, chance=0.01, loss=0.06)
    assert list(sizes) == [200, 400, 800, 1600]
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
    exact = exact if track == "smoke" else exact[::3]  # hundreds of pairs take seconds to plan
    assert [gate for gate in exact if row(gate, track) not in page] == []
    assert page.count("\n| `") == len(GATES) * len(TRACKS)
