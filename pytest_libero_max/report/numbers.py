"""The main numbers of a report under flat names, as trackers of experiments want them."""

from __future__ import annotations

from pytest_libero_max.benchmark.documents import Json

_NAMES = ("base_success", "dynamic_success", "paired_change")


def main_numbers(report: Json) -> dict[str, float]:
    """Pairs and outcomes; rates and changes with their intervals, over all pairs and by event.

    A run that is incomplete has counts, and no rates: it has no score.

    Args:
        report: As in ``report.json``.
    """
    pairs, overall = report["pairs"], report["overall"]
    found: dict[str, float | None] = {
        f"pairs/{name}": pairs[name] for name in ("played", "invalid", "missing")
    }
    found |= {f"outcomes/{name}": count for name, count in overall["outcomes"].items()}
    if pairs["complete"]:
        for name in _NAMES:
            found |= {name: overall[name]["value"]}
            found |= {f"{name}_{end}": overall[name][end] for end in ("lower", "upper")}
        for event, row in report["by"]["event"].items():
            found |= {f"events/{event}/{name}": row[name]["value"] for name in _NAMES}
    return {name: value for name, value in found.items() if value is not None}
