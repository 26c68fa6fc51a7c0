"""Power of each track as plain lines: the smallest effects it resolves, and the pairs that a change needs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from pytest_libero_max.errors import OptionError, counted
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.report.measures import measures_of
from pytest_libero_max.report.render.terminal import aligned
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sections import SECTIONS
from pytest_libero_max.stats.power import detectable_loss, pairs_needed

TRACK_SIZES: Mapping[str, int] = {"smoke": 32, "lite": 800, "max": 8000}
"""Pairs of a track; every event has an eighth of them."""

TARGETS = (0.8, 0.9)


@dataclass(frozen=True)
class Expectation:
    """Expected rates of a set of pairs before it is played."""

    name: str
    """``overall`` or an event."""
    base: float
    gain: float
    """Share of all pairs that fail in Base and succeed in Dynamic by chance, without an effect. As many are
    expected to be lost by chance."""

    @property
    def loss(self) -> float:
        """Share of all pairs that succeed in Base and fail in Dynamic by chance."""
        return min(self.gain, self.base)

    def __post_init__(self) -> None:
        if not (0 <= self.base <= 1 and 0 <= self.gain <= 1 - self.base + 1e-12):
            raise OptionError(
                f"base={self.base!r} and gain={self.gain!r} of {self.name!r}, but must be rates from 0 to 1, "
                "and only a pair that fails in Base can gain (gain <= 1 - base)."
            )


def expectations_of(report: Report) -> tuple[Expectation, ...]:
    """Return what an earlier run lets one expect, overall and for each event that it played.

    The share of pairs that chance changes, either way, is that of :func:`chance_of`, for every event.
    """
    most, _ = chance_of(report)
    blocks = {"overall": report.overall, **report.by["event"]}
    return tuple(
        Expectation(name, rate, min(most, 1 - rate))
        for name, block in blocks.items()
        if block.played and (rate := block.base_success.value) is not None
    )


def chance_of(report: Report) -> tuple[float, str]:
    """Return the share of pairs that chance loses, and gains, and a sentence on where it comes from.

    Where a section measures chance, what it lost or gained, the more of the two, is what chance does; else
    the fewer of the run's gains and regressions are. The share is not taken as exact: it is the upper end of
    a one-sided 95% interval (Clopper and Pearson).
    """
    from scipy import stats

    outcomes, measures = report.overall.outcomes, measures_of(report.sections)
    chance = next(filter(None, (section.chance(measures) for section in SECTIONS.values())), None)
    if chance is None:
        flips, pairs = min(outcomes.change_associated_success, outcomes.regression), report.overall.played
        seen = f"the smaller of the run's gains and losses: {flips} of {counted(pairs, 'pair')}"
    else:
        flips, pairs = max(chance.lost, chance.gained), chance.pairs
        seen = f"{chance.measured_by}: {chance.lost} lost, {chance.gained} gained of {counted(pairs, 'pair')}"
    most = float(stats.beta.ppf(0.95, flips + 1, pairs - flips)) if flips < pairs else 1.0
    return most, f"Chance loses, and gains, at most {most:.1%} of the pairs (95% upper end; {seen})."


def power_lines(expectations: tuple[Expectation, ...], change: float | None = None) -> list[str]:
    """Return the smallest loss and gain that every track resolves, and the pairs that a change needs.

    Args:
        change: A paired change, for example -0.05 (a loss) or 0.05 (a gain), for which the pairs needed are
            added.
    """
    head = [f"{track} {target:.0%}" for track in TRACK_SIZES for target in TARGETS]
    lines = [
        "Smallest loss (percentage points) that the exact McNemar test resolves at level 0.05,",
        "by track and power; n/a where even losing every Base success would not be resolved",
        "",
        *aligned([("", "Base", "gain", *head), *map(_losses, expectations)], numbers=True),
        "",
        "Smallest gain that it resolves; n/a where even gaining every Base failure would not be resolved",
        "",
        *aligned([("", "Base", "loss", *head), *map(_gains, expectations)], numbers=True),
    ]
    if change is not None:
        lines += ["", f"Pairs needed to resolve a change of {100 * change:+.1f} points:"]
        lines += [_needed_line(expected, change) for expected in expectations]
    return lines


def _losses(expected: Expectation) -> tuple[str, ...]:
    """Return the row of an expectation: the smallest share of regressions that each track resolves."""
    found = (
        detectable_loss(pairs, expected.gain, target, expected.base) for pairs, target in _trials(expected)
    )
    return _row(expected, expected.gain, found, -1)


def _gains(expected: Expectation) -> tuple[str, ...]:
    """Return the row of its gains: McNemar's test does not care which side is which."""
    most = 1 - expected.base
    found = (detectable_loss(pairs, expected.loss, target, most) for pairs, target in _trials(expected))
    return _row(expected, expected.loss, found, 1)


def _trials(expected: Expectation) -> Iterator[tuple[int, float]]:
    """Yield the pairs of each track, with each power."""
    for size in TRACK_SIZES.values():
        pairs = size if expected.name == "overall" else size // len(BENCHMARK_EVENTS)
        for target in TARGETS:
            yield pairs, target


def _needed_line(expected: Expectation, change: float) -> str:
    loss = expected.gain - change if change <= 0 else expected.loss
    gain = expected.gain if change <= 0 else expected.loss + change
    if loss > expected.base:
        return f"{expected.name:<22} impossible: at most {expected.base:.1%} of the pairs can regress"
    if gain > 1 - expected.base + 1e-12:
        return f"{expected.name:<22} impossible: at most {1 - expected.base:.1%} of the pairs can gain"
    needed = [pairs_needed(loss, gain, target) for target in TARGETS]
    texts = [
        f"{'more than a million' if pairs is None else pairs} at {target:.0%} power"
        for pairs, target in zip(needed, TARGETS, strict=True)
    ]
    return f"{expected.name:<22} {', '.join(texts)}"


def _row(
    expected: Expectation, by_chance: float, found: Iterable[float | None], sign: int
) -> tuple[str, ...]:
    """Return the cells of an expectation, with the change beyond chance of each share that was found."""
    changes = ("n/a" if one is None else f"{sign * 100 * (one - by_chance):+.1f}" for one in found)
    return (expected.name, f"{expected.base:.1%}", f"{by_chance:.1%}", *changes)
