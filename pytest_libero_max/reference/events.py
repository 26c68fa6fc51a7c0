"""The page of the events: what each does to a world, with its numbers, and what is expected of a policy."""

from __future__ import annotations

import json
import sys
from types import ModuleType

from pytest_libero_max import events
from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.events import triggers
from pytest_libero_max.events.kind import EventKind
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, EVENTS
from pytest_libero_max.reference.docstrings import constants, description, section
from pytest_libero_max.reference.markdown import code, one_line, prose, table

EXAMPLES = "smoke"
"""The track that the examples are from."""


def page() -> str:
    """The text."""
    kinds = [EVENTS[name] for name in BENCHMARK_EVENTS]
    overview = table(
        ("Event", "Family", "Severity of variant 0, 1", "Response"),
        (
            (f"[{kind.name}](#{kind.name})", kind.family, ", ".join(kind.severities), kind.response)
            for kind in kinds
        ),
    )
    examples = _examples()
    return f"""# Events

{prose(description(events))}

Each event has two parameter variants, 0 and 1. The numbers are those of the benchmark's authors.

![Each event, before and after](../../reports/events.jpg)

{overview}

The examples are changes of cases of the `{EXAMPLES}` track, as manifests spell them.

{"".join(_kind(kind, examples) for kind in kinds)}
## Triggers

When an event happens. All cases of the tracks use `on_proximity`.

{_triggers()}
"""


def _kind(kind: EventKind, examples: dict[tuple[str, int], Case]) -> str:
    module = sys.modules[type(kind).__module__]
    rows = [
        ("Family", f"{kind.family} (`{kind.code}` in manifests)"),
        ("Severity", f"{kind.severities[0]} (variant 0), {kind.severities[1]} (variant 1)"),
        ("The task needs", kind.needs),
        ("A policy is expected to", f"{kind.expected} (`{kind.response}`)"),
        *_numbers(module),
    ]
    shown = "".join(_example(variant, examples[kind.name, variant]) for variant in (0, 1))
    return f"## {kind.name}\n\n{prose(description(type(kind)))}\n\n{table(('', ''), rows)}\n\n{shown}"


def _numbers(module: ModuleType) -> list[tuple[str, str]]:
    return [(code(item.name), f"`{item.value}`. {one_line(item.text)}") for item in constants(module)]


def _example(variant: int, case: Case) -> str:
    change = json.dumps(case.event.change, sort_keys=False)
    return f"Variant {variant}, in `{case.item_id}`:\n\n```json\n{change}\n```\n\n"


def _examples() -> dict[tuple[str, int], Case]:
    """The first case of each event and variant, by item id."""
    found: dict[tuple[str, int], Case] = {}
    for case in sorted(load_track(EXAMPLES).cases, key=lambda case: case.item_id):
        found.setdefault((case.event.name, case.event.variant), case)
    return found


def _triggers() -> str:
    rows = []
    for name, trigger in triggers.TRIGGERS.items():
        parameters = "; ".join(
            f"`{trigger.spelling.get(field, field)}`: {text}"
            for field, text in section(trigger, "Attributes").items()
        )
        rows.append((code(name), one_line(description(trigger)), one_line(parameters)))
    return table(("Type", "Fires at", "Parameters"), rows)
