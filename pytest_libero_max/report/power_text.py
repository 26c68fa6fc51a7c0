"""How many pairs do I need? What each track can resolve, as plain lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.stats.power import detectable_loss, pairs_needed

TRACK_SIZES: Mapping[str, int] = {"smoke": 32, "lite": 800, "max": 8000}
"""Pairs of a track; every event has an eighth of them."""

TARGETS = (0.8, 0.9)


@dataclass(frozen=True)
class Expectation:
    """What is expected of a set of pairs before it is played.

    Attributes:
        name: ``overall`` or an event.
        base: Base success rate.
        gain: Share of all pairs that fail in Base and succeed in Dynamic, with or without an effect.
    """

    name: str
    base: float
    gain: float

    def __post_init__(self) -> None:
        if not (0 <= self.base <= 1 and 0 <= self.gain <= 1 - self.base + 1e-12):
            raise OptionError(
                f"base={self.base!r} and gain={self.gain!r} of {self.name!r}, but must be rates from 0 to 1, "
                "and only a pair that fails in Base can gain (gain <= 1 - base)."
            )


def expectations_of(report: Json) -> tuple[Expectation, ...]:
    """What an earlier run lets one expect, overall and for each event it played."""
    blocks = {"overall": report["overall"], **report["by"]["event"]}
    return tuple(
        Expectation(
            name,
            block["base_success"]["value"],
            block["outcomes"]["change_associated_success"] / block["played"],
        )
        for name, block in blocks.items()
        if block["played"]
    )


def power_lines(expectations: tuple[Expectation, ...], change: float | None = None) -> list[str]:
    """The smallest paired change every track resolves, in percentage points, and the pairs a change needs.

    Args:
        expectations: For the whole run or single events.
        change: A paired change, for example -0.05, for which the pairs needed are added.
    """
    head = [f"{track} {target:.0%}" for track in TRACK_SIZES for target in TARGETS]
    lines = [
        "Smallest loss (percentage points) that the exact McNemar test resolves at level 0.05,",
        "by track and power; n/a where even losing every Base success would not be resolved",
        "",
        _row("", "Base", "gain", head),
    ]
    for expected in expectations:
        cells = [_loss_text(loss, expected) for loss in _losses(expected)]
        lines.append(_row(expected.name, f"{expected.base:.1%}", f"{expected.gain:.1%}", cells))
    if change is not None:
        lines += ["", f"Pairs needed to resolve a change of {100 * change:+.1f} points:"]
        lines += [_needed_line(expected, change) for expected in expectations]
    return lines


def _losses(expected: Expectation) -> Iterator[float | None]:
    for size in TRACK_SIZES.values():
        pairs = size if expected.name == "overall" else size // len(BENCHMARK_EVENTS)
        for target in TARGETS:
            yield detectable_loss(pairs, expected.gain, target, expected.base)


def _loss_text(loss: float | None, expected: Expectation) -> str:
    return "n/a" if loss is None else f"{100 * (expected.gain - loss):+.1f}"


def _needed_line(expected: Expectation, change: float) -> str:
    loss = expected.gain - change
    if not 0 <= loss <= expected.base:
        return f"{expected.name:<22} impossible: at most {expected.base:.1%} of the pairs can regress"
    needed = [pairs_needed(loss, expected.gain, target) for target in TARGETS]
    texts = [
        f"{'more than a million' if pairs is None else pairs} at {target:.0%} power"
        for pairs, target in zip(needed, TARGETS, strict=True)
    ]
    return f"{expected.name:<22} {', '.join(texts)}"


def _row(name: str, base: str, gain: str, cells: list[str]) -> str:
    return f"{name:<22} {base:>6} {gain:>6} " + " ".join(f"{cell:>9}" for cell in cells)
