"""The plan of a gate as plain lines: how often it passes, by the true loss."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.gate_plan import (
    FALSE_ALARM,
    MISS,
    SIZES,
    advised,
    chance_of_passing,
    useful_sizes,
)
from pytest_libero_max.report.gates import Gate, require_known_groups
from pytest_libero_max.report.render.terminal import aligned
from pytest_libero_max.report.writers.power_text import TRACK_SIZES
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.gate_power import Chances

LOSSES = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)
"""True losses that are shown where none is asked for, beside the losses by chance."""


def gate_plan_lines(
    gate: Gate,
    pairs: int | Sequence[PlannedPair],
    base: float,
    chance: float,
    loss: float | None = None,
) -> list[str]:
    """Return the plan of a gate.

    Args:
        pairs: Number of pairs that it is decided on, or the pairs of a track.
        base: Base success rate; against another run, Dynamic success of that run.
        chance: Share of pairs lost, and gained, by chance alone.
        loss: Share of pairs lost by an effect, and by chance; None for several.

    Raises:
        OptionError: The gate cannot be planned, no pair is of its group, or the rates cannot be.
    """
    planned = () if isinstance(pairs, int) else tuple(_of_group(gate, pairs))
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
    """Return which gate, on how many pairs of which track, finds a loss.

    Args:
        chance: Share of pairs lost, and gained, by chance alone.
        effect: Share of pairs that the loss costs beside, above 0.
    """
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


def _of_group(gate: Gate, pairs: Sequence[PlannedPair]) -> Iterator[PlannedPair]:
    require_known_groups([gate], pairs)
    if gate.scope is None:
        yield from pairs
        return
    dimension, group = gate.scope
    yield from (pair for pair in pairs if DIMENSIONS[dimension].label(pair) == group)
