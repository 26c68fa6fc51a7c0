"""Gates before anything is played: probabilities that one passes, by the true loss of the policy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.gate_arguments import refused
from pytest_libero_max.report.gates import (
    EQUIVALENCE_CONFIDENCE,
    EQUIVALENT,
    Gate,
    meets,
    parse_gate,
    require_known_groups,
)
from pytest_libero_max.report.render.terminal import aligned
from pytest_libero_max.report.writers.power_text import TRACK_SIZES
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.intervals import CONFIDENCE, clopper_pearson
from pytest_libero_max.stats.paired_difference import exact
from pytest_libero_max.stats.power import (
    Chances,
    Counts,
    chance_by_task,
    chance_of_count,
    chance_of_losses,
)
from pytest_libero_max.stats.ratios import Ratio

SIZES = (8, 16, 32, 64, 100, 200, 400, 800, 1600, 3200, 8000)
"""Numbers of pairs that are tried for those at which a gate is of use."""

FALSE_ALARM = 0.05
"""Largest probability that a gate of use fails a policy without an effect."""

MISS = 0.2
"""Largest probability that a gate of use passes a policy with the effect that it is to find."""

_COUNTS = {"regressions": "loss", "regressions_vs": "loss", "gains": "gain", "gains_vs": "gain"}
_DIFFERENCES = ("delta", "dynamic_sr_vs")

PLANNED = (*_DIFFERENCES, "delta.clustered", EQUIVALENT, *_COUNTS, "base_sr", "dynamic_sr")
"""Quantities of gates that can be planned."""


def chance_of_passing(gate: Gate, pairs: int, chances: Chances, planned: Sequence[PlannedPair] = ()) -> float:
    """Return the probability that a gate passes.

    Args:
        planned: These pairs, for a quantity by task.
    """
    if gate.name not in PLANNED or gate.operator in ("==", "!="):
        raise refused(
            gate.text, f" cannot be planned. What can: limits (>=, >, <=, <) for {', '.join(PLANNED)}."
        )
    if gate.name == EQUIVALENT:
        margin = float(gate.threshold)
        lower, upper = (_end(pairs, end, EQUIVALENCE_CONFIDENCE) for end in ("lower", "upper"))
        return chance_of_losses(
            pairs,
            chances,
            begins=lambda gains, losses: upper(gains, losses) < margin,
            ends=lambda gains, losses: lower(gains, losses) <= -margin,
        )
    if gate.name in _DIFFERENCES:
        value = _end(pairs, gate.end, CONFIDENCE)

        def met(gains: Counts, losses: Counts) -> NDArray[np.bool_]:
            found = value(gains, losses).tolist()
            return np.array([meets(gate, one) for one in found], dtype=np.bool_)

        if gate.operator in ("<=", "<"):
            return chance_of_losses(pairs, chances, begins=met)
        return chance_of_losses(pairs, chances, ends=lambda gains, losses: ~met(gains, losses))
    if gate.name == "delta.clustered":
        return _chance_by_task(gate, chances, planned)
    if gate.name in _COUNTS:
        return chance_of_count(pairs, getattr(chances, _COUNTS[gate.name]), lambda count: meets(gate, count))
    rate = chances.base if gate.name == "base_sr" else chances.base - chances.loss + chances.gain
    return chance_of_count(pairs, rate, lambda count: _rate_meets(gate, count, pairs))


def _chance_by_task(gate: Gate, chances: Chances, planned: Sequence[PlannedPair]) -> float:
    if not planned:
        raise refused(gate.text, " is by task: give --track, whose tasks are known.")
    if gate.end is None:
        raise refused(gate.text, " has no end. Write delta, or delta.clustered.lower.")
    tasks = [pair.task for pair in planned]
    at = ("lower", "upper").index(gate.end)
    return chance_by_task(tasks, chances, lambda *ends: meets(gate, ends[at]))


def useful_sizes(gate: Gate, base: float, chance: float, loss: float) -> Iterator[int]:
    """Yield the numbers of pairs, of :data:`SIZES`, at which a gate tells a loss from none.

    There a policy without an effect fails with at most :data:`FALSE_ALARM`, and one that loses so much passes
    with at most :data:`MISS`.
    """
    alike, hurt = Chances(base, chance, chance), Chances(base, loss, chance)
    for pairs in SIZES:
        if (
            chance_of_passing(gate, pairs, hurt) <= MISS
            and chance_of_passing(gate, pairs, alike) >= 1 - FALSE_ALARM
        ):
            yield pairs


@dataclass(frozen=True)
class Advice:
    """A gate and the number of pairs from which on it finds a loss."""

    gate: Gate
    pairs: int | None
    """The smallest of :data:`SIZES` that suffices; None where none does."""
    without: float
    """Probability that it passes there without an effect."""
    hurt: float
    """Probability that it passes there with the loss."""


def advised(base: float, chance: float, effect: float) -> tuple[Advice, ...]:
    """Return gates for a loss, each with the fewest pairs at which it tells the loss from none.

    Tried are a limit on the end of the interval, at the loss, and one on the estimate, half way. What tells
    them apart is :func:`useful_sizes`.

    Args:
        chance: Share of pairs lost, and gained, by chance alone.
        effect: Share of pairs that the loss to be found costs beside, above 0.
    """
    found = []
    for text in (f"delta.lower >= -{100 * effect:g}%", f"delta >= -{50 * effect:g}%"):
        gate = parse_gate(text)
        pairs = next(useful_sizes(gate, base, chance, chance + effect), None)
        hurt, alike = (Chances(base, loss, chance) for loss in (chance + effect, chance))
        size = pairs or SIZES[-1]
        found.append(
            Advice(gate, pairs, chance_of_passing(gate, size, alike), chance_of_passing(gate, size, hurt))
        )
    return tuple(found)


def pairs_to_show(gate: Gate, more_than: int, loss: float, gain: float) -> int | None:
    """Return the smallest of :data:`SIZES` at which runs with these shares mostly pass a gate.

    Returns:
        None where the gate cannot be planned, or no size suffices.
    """
    if gate.name not in _DIFFERENCES or gate.operator in ("==", "!="):
        return None
    chances = Chances(1 - gain, loss, gain)
    larger = (pairs for pairs in SIZES if pairs > more_than)
    return next((pairs for pairs in larger if chance_of_passing(gate, pairs, chances) >= 1 - MISS), None)


def _end(pairs: int, end: str | None, confidence: float) -> Callable[[Counts, Counts], NDArray[np.float64]]:
    def value(gains: Counts, losses: Counts) -> NDArray[np.float64]:
        if end is None:
            return (gains - losses) / pairs
        return np.round(exact(losses, gains, np.full_like(gains, pairs), confidence)[end == "upper"], 9)

    return value


def _rate_meets(gate: Gate, count: int, pairs: int) -> bool:
    ratio = Ratio(count, pairs)
    interval = clopper_pearson(ratio)
    assert interval is not None
    return meets(gate, count / pairs if gate.end is None else getattr(interval, gate.end))


LOSSES = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)
"""True losses that are shown where none is asked for, beside the losses by chance."""


def gate_plan_lines(
    gate: Gate, pairs: int | Sequence[PlannedPair], base: float, chance: float, loss: float | None = None
) -> list[str]:
    """Return the plan of a gate.

    Args:
        pairs: Number of pairs that it is decided on, or the pairs of a track.
        base: Base success rate; against another run, Dynamic success of that run.
        chance: Share of pairs lost, and gained, by chance alone.
        loss: Share of pairs lost by an effect, and by chance; None for several.
    """
    planned: Sequence[PlannedPair] = ()
    if not isinstance(pairs, int):
        require_known_groups([gate], pairs)
        planned = gate.of_scope(pairs)
    count = pairs if isinstance(pairs, int) else len(planned)
    lines = [
        f"{gate.text}, decided on {counted(count, 'pair')}",
        f"{'Dynamic success there' if gate.run else 'Base'} {base:.1%}; chance loses {chance:.1%} of the "
        "pairs and gains as many",
        "",
        f"{'True change':>11}  {'passes':>7}",
    ]
    losses = [chance + effect for effect in LOSSES] if loss is None else [chance, loss]
    for lost in dict.fromkeys(lost for lost in losses if loss is not None or lost <= base):
        passing = chance_of_passing(gate, count, Chances(base, lost, chance), planned)
        note = "  no effect: each failure here is a false alarm" if lost == chance else ""
        lines.append(f"{100 * (chance - lost):>+8.1f} pp  {passing:>7.1%}{note}")
    if loss is not None and gate.name != "delta.clustered":
        sizes = ", ".join(map(str, useful_sizes(gate, base, chance, loss))) or "none"
        lines += [
            "",
            f"Numbers of pairs, {SIZES[0]} to {SIZES[-1]}, at which at most {FALSE_ALARM:.0%} of runs fail",
            f"without an effect and at most {MISS:.0%} pass with {100 * (chance - loss):+.1f} pp: {sizes}.",
        ]
    return lines


def advice_lines(base: float, chance: float, effect: float) -> list[str]:
    """Return which gate, on how many pairs of which track, finds a loss."""
    lines = [
        f"Gates that find a loss of {100 * effect:g} points: with the loss at most {MISS:.0%} of runs pass, "
        f"without it at least {1 - FALSE_ALARM:.0%}",
        "",
    ]
    rows = [("gate", "pairs", "passes without", "with it", "options")]
    for advice in advised(base, chance, effect):
        if advice.pairs is None:
            rows.append((advice.gate.text, "none", "", "", f"no number up to {SIZES[-1]} suffices"))
            continue
        track, size = next(one for one in TRACK_SIZES.items() if one[1] >= advice.pairs)
        limit = f" --libero-max-limit={advice.pairs}" if advice.pairs < size else ""
        passes = (f"{advice.without:.1%}", f"{advice.hurt:.1%}")
        rows.append((advice.gate.text, str(advice.pairs), *passes, f"--libero-max-track={track}{limit}"))
    beside = "Add gates on base_sr and trigger_coverage: a policy that solves little has little to lose."
    return [*lines, *aligned(rows), "", beside]
