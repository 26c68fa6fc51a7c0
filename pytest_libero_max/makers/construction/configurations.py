"""Source variations that can host each event, and how many there are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache

from pytest_libero_max.events.configurations import OWN
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.substrates.contract import Catalogue
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.tasks.contents import TaskMetadata
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES, PRO_CATEGORIES


@cache
def hosts(
    source: str, category: str, origin: Catalogue = OWN
) -> tuple[tuple[Variation, frozenset[str]], ...]:
    """Return the variations of a source category, each with the events that its scene can host.

    LIBERO-Plus's variations without a difficulty are left out, as in the released benchmark.
    """
    return tuple(
        (variation, _events_of(origin.metadata(variation)))
        for variation in origin.variations(source)
        if variation.category == category and (source == "pro" or variation.difficulty is not None)
    )


def _events_of(task: TaskMetadata) -> frozenset[str]:
    """Return the benchmark's events that a scene can host, without those of other packages."""
    return frozenset(event for event in BENCHMARK_EVENTS if eligible(event, task))


def eligibility_lines(origin: Catalogue = OWN) -> list[str]:
    """Lines on the number of variations of each source category that can host each event."""
    names = "".join(f"{event.split('_')[0]:>13}" for event in BENCHMARK_EVENTS)
    lines = [f"{'category':<30}{'tasks':>7}{names}"]
    for source, categories in (("plus", PLUS_CATEGORIES), ("pro", PRO_CATEGORIES)):
        total = Counter[str]()
        for category in categories:
            hosted = [events for _, events in hosts(source, category, origin)]
            total += _add_row(lines, category, hosted)
        lines.append(_row(f"all of {source}", total))
        left_out = [
            _events_of(origin.metadata(variation))
            for variation in origin.variations(source)
            if source == "plus" and variation.difficulty is None
        ]
        if left_out:
            total += _add_row(lines, "no difficulty, in no track", left_out)
            lines.append(_row(f"all of {source}, with these", total))
    return lines


def _add_row(lines: list[str], name: str, hosted: Sequence[frozenset[str]]) -> Counter[str]:
    count = Counter(event for events in hosted for event in events) + Counter(tasks=len(hosted))
    lines.append(_row(name, count))
    return count


def _row(name: str, count: Counter[str]) -> str:
    return f"{name:<30}{count['tasks']:>7}" + "".join(f"{count[event]:>13}" for event in BENCHMARK_EVENTS)
