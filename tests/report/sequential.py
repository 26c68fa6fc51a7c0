"""How often rules that stop early err, and how many pairs they save: ``reports/sequential.md``.

``python -m tests.report.sequential`` prints that file. It takes about ten minutes of an idle core.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.gates import parse_gates
from pytest_libero_max.report.stopping_rule import CompletedPrefix, parse_rule
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.store import read_pairs
from pytest_libero_max.stats.power import power
from tests.stats.capital import capital

LEVEL = 0.05
PAIRS = 800
RUNS = 10_000
_AT_ONCE = 250
LIMIT = -40
"""The margin of -5% as a number of pairs: gains less losses over all of them."""

NULLS = ((0.05, 0.05), (0.15, 0.15), (0.30, 0.30))
"""Shares of lost and of gained pairs without a change."""

EFFECTS = ((0.07, 0.05), (0.10, 0.05), (0.15, 0.05), (0.20, 0.03), (0.30, 0.01))

SUMS = ((0.0, 0.0), (0.02, 0.0), (0.05, 0.05), (0.15, 0.02), (0.40, 0.02))
"""Shares of lost and of gained pairs in fixed sets of cases."""

GATED = (
    (0.0, 0.0),
    (0.02, 0.02),
    (0.05, 0.05),
    (0.05, 0.03),
    (0.10, 0.05),
    (0.10, 0.04875),
    (0.05125, 0.0),
    (0.08, 0.02),
    (0.10, 0.03),
    (0.15, 0.02),
    (0.25, 0.01),
)

SEEDS = range(1, 11)
PUBLISHED = ("expert", "stale_expert")
GATES = ("delta.lower >= -5%", "delta >= -5%", "base_sr >= 80%")

IntArray = NDArray[np.int64]
Draw = Callable[[float, float, int, int, np.random.Generator], IntArray]


def coins(losses: float, gains: float, runs: int, pairs: int, rng: np.random.Generator) -> IntArray:
    """Draw runs of independent pairs: -1 for a loss, 1 for a gain, 0 otherwise. Shape (runs, pairs)."""
    drawn = rng.random((runs, pairs))
    return (drawn >= 1 - gains).astype(np.int64) - (drawn < losses)


def orders(losses: float, gains: float, runs: int, pairs: int, rng: np.random.Generator) -> IntArray:
    """Draw orders of a fixed set of cases. Shape (runs, pairs)."""
    lost, gained = round(losses * pairs), round(gains * pairs)
    cases = np.repeat([-1, 1, 0], [lost, gained, pairs - lost - gained])
    return rng.permuted(np.tile(cases, (runs, 1)), axis=1)


def first(found: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Number of pairs after which something is found first; infinite where never. Shape (runs,)."""
    return np.where(found.any(axis=1), found.argmax(axis=1) + 1, math.inf)


def change_found(runs: IntArray) -> NDArray[np.float64]:
    """Number of pairs after which the evidence of a change reaches 1 / LEVEL."""
    losses, gains = (np.cumsum(runs == kind, axis=1) for kind in (-1, 1))
    evidence = special.betaln(losses + 1, gains + 1) + (losses + gains) * math.log(2)
    return first(evidence >= -math.log(LEVEL))


def fixed_test_peeked(runs: IntArray) -> NDArray[np.float64]:
    """Number of pairs after which the exact McNemar test for a fixed number of pairs first has p <= LEVEL."""
    losses, gains = (np.cumsum(runs == kind, axis=1) for kind in (-1, 1))
    return first(np.minimum(losses, gains) <= _least_extreme()[losses + gains])


@cache
def _least_extreme() -> IntArray:
    """Largest smaller count with p <= LEVEL, by the number of discordant pairs; -1 for none."""
    found: IntArray = stats.binom.ppf(LEVEL / 2, np.arange(PAIRS + 1), 0.5).astype(np.int64) - 1
    return found


def below(runs: IntArray, total: int) -> NDArray[np.float64]:
    """Number of pairs after which a sequence for gains less losses has left out ``total`` as too small."""
    return first(capital(runs, total, -1) >= 2 / LEVEL)


def above(runs: IntArray, total: int) -> NDArray[np.float64]:
    """Number of pairs after which a sequence has left out ``total`` as too large."""
    return below(-runs, -total)


def certain(runs: IntArray) -> NDArray[np.float64]:
    """Number of pairs after which no remaining outcome changes the gate ``delta >= -5%``."""
    change, left = np.cumsum(runs, axis=1), np.arange(runs.shape[1])[::-1]
    return first((change - left >= LIMIT) | (change + left < LIMIT))


def in_parts(draw: Draw, losses: float, gains: float, count: int, seed: int) -> Iterator[IntArray]:
    """Draw ``count`` runs in parts that fit into memory, with a seed of their own."""
    rng = np.random.default_rng([seed, round(1000 * losses), round(1000 * gains)])
    for begin in range(0, count, _AT_ONCE):
        yield draw(losses, gains, min(_AT_ONCE, count - begin), PAIRS, rng)


def null_row(losses: float, gains: float, count: int) -> list[str]:
    """No change: how often one is found, by the sequential test and by peeking at a fixed one."""
    rates = []
    for draw in (coins, orders):
        parts = [*in_parts(draw, losses, gains, count, 1)]
        rates += [
            _share(change_found(part) for part in parts),
            _share(fixed_test_peeked(part) for part in parts),
        ]
    return [shares(losses, gains), *map(_percent, rates)]


def effect_row(losses: float, gains: float, count: int) -> list[str]:
    """A change: how often it is found, and when."""
    stops = np.concatenate([change_found(part) for part in in_parts(coins, losses, gains, count, 2)])
    found = np.isfinite(stops)
    return [
        shares(losses, gains),
        _percent(float(found.mean())),
        _percent(power(PAIRS, losses, gains, LEVEL)),
        str(int(np.median(np.minimum(stops, PAIRS)))),
        str(round(float(np.minimum(stops, PAIRS).mean()))),
    ]


def bias_row(losses: float, gains: float, count: int) -> list[str]:
    """A change: the mean estimate of the runs that are stopped by it, and of all runs."""
    stops, estimates = [], []
    for part in in_parts(coins, losses, gains, count, 5):
        at = change_found(part)
        last = np.minimum(at, PAIRS).astype(np.int64)
        estimates.append(np.take_along_axis(np.cumsum(part, axis=1), last[:, None] - 1, axis=1)[:, 0] / last)
        stops.append(at < PAIRS)
    stopped, estimate = np.concatenate(stops), np.concatenate(estimates)
    means = (gains - losses, float(estimate[stopped].mean()), float(estimate.mean()))
    row = [f"{100 * mean:+.1f} pp" for mean in means]
    return [shares(losses, gains), row[0], _percent(float(stopped.mean())), *row[1:]]


def miss_row(losses: float, gains: float, count: int) -> list[str]:
    """A fixed set of cases: how often its change is left out of the sequence at any of 800 looks."""
    total = round(gains * PAIRS) - round(losses * PAIRS)
    missed = [
        np.isfinite(np.minimum(below(part, total), above(part, total)))
        for part in _orders(losses, gains, count, 3)
    ]
    return [shares(losses, gains), _percent(float(np.concatenate(missed).mean()))]


def gate_row(losses: float, gains: float, count: int) -> list[str]:
    """The gate ``delta >= -5%`` on a fixed set of cases: verdicts before the last pair, and when."""
    passes = round(gains * PAIRS) - round(losses * PAIRS) >= LIMIT
    stops, wrong, sure = [], 0, []
    for part in _orders(losses, gains, count, 4):
        passed, failed = below(part, LIMIT - 1), above(part, LIMIT)
        right, other = (passed, failed) if passes else (failed, passed)
        wrong += int((other < right).sum())
        stops.append(np.minimum(right, other))
        sure.append(certain(part))
    at = np.minimum(np.concatenate(stops), PAIRS)
    return [
        shares(losses, gains),
        f"{100 * (gains - losses):+.1f} pp",
        "passes" if passes else "fails",
        _percent(wrong / count),
        *(str(int(np.quantile(at, q))) for q in (0.5, 0.9)),
        str(int(np.median(np.concatenate(sure)))),
    ]


class Stopped(NamedTuple):
    """A published run that is played again in another order, as far as a rule lets it."""

    at: int
    verdict: str


def replayed(policy: str, rule: str, gate: str, seed: int) -> Stopped:
    """Let a rule decide on the published pairs of a policy on ``lite``, in a random order.

    A rule is a function of the first pairs in the order of play, so this is where the run would have stopped.
    """
    named = parse_rule(rule)
    order = [PlannedPair.of(case) for case in Order.parse(f"shuffled:{seed}").of(load_track("lite").cases)]
    prefix = CompletedPrefix(named, order, parse_gates([gate] if gate else []))
    for pair in order:
        if (stopped := prefix.add(pair.item_id, _published(policy)[pair.item_id])) is not None:
            assert stopped.at is not None
            return Stopped(stopped.at, next((f"{w.verdict}" for w in named.rule.watched()), ""))
    return Stopped(len(order), "at the end")


@cache
def _published(policy: str) -> dict[str, PairRecord]:
    folder = Path(__file__).parents[2] / "reports" / "lite" / policy
    return {record.item_id: record for record in read_pairs(folder).records}


def replay_row(policy: str, gate: str, rule: str, seeds: Sequence[int]) -> list[str]:
    """Where a rule stops the published run of a policy on lite, over seeds of the order."""
    found = [replayed(policy, rule, gate, seed) for seed in seeds]
    at = sorted(stop.at for stop in found)
    verdicts = sorted({stop.verdict for stop in found})
    return [
        policy,
        f"`{gate}`",
        f"`{rule}`",
        ", ".join(f"{verdict} {sum(stop.verdict == verdict for stop in found)}" for verdict in verdicts),
        str(int(np.median(at))),
        f"{at[0]} to {at[-1]}",
    ]


def replay_rows(policy: str) -> Iterator[list[str]]:
    """Rows of a policy for every gate and rule."""
    for gate in GATES:
        yield replay_row(policy, gate, "anytime:0.05", SEEDS)
        yield replay_row(policy, gate, "certain", SEEDS[:1])


def _orders(losses: float, gains: float, count: int, seed: int) -> Iterator[IntArray]:
    return in_parts(orders, losses, gains, count, seed)


def _share(stops: Iterable[NDArray[np.float64]]) -> float:
    return float(np.isfinite(np.concatenate([*stops])).mean())


def shares(losses: float, gains: float) -> str:
    """Return both shares as a row names them."""
    return f"{100 * losses:g}% / {100 * gains:g}%"


def _percent(share: float) -> str:
    return f"{100 * share:.1f}%"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    return [*lines, *(f"| {' | '.join(row)} |" for row in rows)]


HEAD = """# Rules that stop early: how often they err, and how many pairs they save

Where nothing is lost, a fixed test that is looked at after every pair finds a change in 21 to 35% of the
runs, `anytime` in less than 4%. A loss of 15% of the pairs against gains of 5% is found after 144 of 800
pairs, in the median. What a stopped run estimates is beyond the truth, because that is what stopped it.

| lost / gained, independent pairs | `anytime` finds a change | median pairs of 800 |
| --- | --- | --- |
| 15% / 15% | 3.2% | 800 |
| 10% / 5% | 78.9% | 458 |
| 15% / 5% | 100.0% | 144 |
| 30% / 1% | 100.0% | 27 |

`--libero-max-stop=certain` and `anytime:LEVEL` look after every pair
([how to use them](../docs/how-to/long-runs.md#stop-early)). Here the level is 0.05, and a run has
800 pairs as in `lite`. A row is of 10,000 runs unless its table says otherwise. Made by
`python -m tests.report.sequential`; a [test](../tests/report/test_sequential.py) makes a small part again.

What is random differs between the tables. *Independent pairs*: each pair is drawn anew. *Random order*: the
cases and their outcomes are fixed, as those of a frozen track under a policy that gives the same answer
twice, and only the seed of `shuffled:SEED` decides what is seen first. With gates `anytime` speaks of the
latter, of all planned pairs of this run. It makes no statement on other cases.
"""

PLAYED = """
## Two runs that stopped

Played on 2026-11-23 with one worker, `--libero-max-gate="delta.lower >= -5%"` and the order `shuffled:1`:

```sh
pytest --libero-max-policy=stale_expert --libero-max-track=lite --libero-max-gate="delta.lower >= -5%" \\
  --libero-max-order=shuffled:1 --libero-max-stop=anytime:0.05 -n 1
```

| policy | stopped at | pairs saved | verdict |
| --- | --- | --- | --- |
| noop | 12 of 800 | 788 | undecidable: Base success is shown to be too low for anything to be lost |
| stale_expert | 27 of 800 | 773 | failed: lower end at most -5.8%, change between -60.8% and -3.8% |

The published pairs of `stale_expert` in the same order stop at the same pair. Those of `expert` stop at 149
of 800 with the verdict passed: 651 pairs saved.
"""
"""Runs that were played and stopped."""


def page() -> Iterator[str]:
    """Yield the lines of the page."""
    yield HEAD
    yield "## Without a change: how often one is found\n"
    yield "Without gates, and the exact McNemar test for a fixed number, looked at after every pair.\n"
    head = ["lost / gained"]
    for what in ("independent pairs", "random order"):
        head += [f"`anytime`, {what}", f"fixed test, {what}"]
    yield from table(head, (null_row(*cell, RUNS) for cell in NULLS))
    yield "\n## With a change: how often it is found, and when\n"
    yield "Independent pairs. A run in which nothing is found counts with its 800 pairs.\n"
    head = ["lost / gained", "found", "by the fixed test at 800 pairs", "median pairs", "mean pairs"]
    yield from table(head, (effect_row(*cell, RUNS) for cell in EFFECTS))
    yield "\n## What a stopped run estimates\n"
    yield (
        "Independent pairs, `anytime` without gates. *All* are the runs that are stopped and those that are "
        "played to the end.\nThe mean of the stopped ones is beyond the truth, because it is what stopped "
        "them. Reports of stopped runs say so.\n"
    )
    head = ["lost / gained", "change", "stopped", "mean estimate of the stopped", "of all"]
    yield from table(head, (bias_row(*cell, RUNS) for cell in EFFECTS))
    yield "\n## The interval: how often it misses at any look\n"
    yield "Random order. Orders in which the change over all 800 pairs is ever outside of the sequence.\n"
    yield from table(["lost / gained", "missed"], (miss_row(*cell, RUNS) for cell in SUMS))
    yield "\n## A gate with a margin: `delta >= -5%`\n"
    yield "Random order, 2,000 runs a row. *Wrong*: stopped with another verdict than after 800.\n"
    head = [
        "lost / gained",
        "change",
        "all pairs",
        "wrong",
        "median pairs",
        "90% of runs by",
        "`certain`, median",
    ]
    yield from table(head, (gate_row(*cell, RUNS // 5) for cell in GATED))
    yield "\n## Published runs\n"
    yield (
        f"The [published pairs](lite) of `lite` in random orders, seeds 1 to {len(SEEDS)}; `certain` with "
        "the first.\nA rule is a function of the first pairs, so such runs stop at these pairs.\n"
    )
    head = ["policy", "gate", "rule", "verdicts", "median pairs", "range"]
    yield from table(head, (row for policy in PUBLISHED for row in replay_rows(policy)))
    yield PLAYED


if __name__ == "__main__":
    print("\n".join(page()))
