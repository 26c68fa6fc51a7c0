"""The page of the events: what each does to a world, with its numbers, and what is expected of a policy."""

from __future__ import annotations

import json
from importlib import import_module
from types import ModuleType

from pytest_libero_max import events
from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.programs import find_program, parse_program, program_names
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.events import triggers
from pytest_libero_max.events.kind import EventKind
from pytest_libero_max.events.registry import EVENTS
from tests.reference.docstrings import constants, description, section
from tests.reference.markdown import code, one_line, prose, table

EXAMPLES = "original"
"""The track that the examples are from."""


_KINDS = "pytest_libero_max.events.kinds."
"""Begins the names of the modules of this package's events; other packages may have added some."""


def page() -> str:
    """The text."""
    kinds = [kind for kind in EVENTS.values() if type(kind).__module__.startswith(_KINDS)]
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

![Each event, before and after](../../reports/events.webp)

{overview}

The examples are changes of cases of the `{EXAMPLES}` track, as manifests spell them.

{"".join(_kind(kind, examples) for kind in kinds)}
## Triggers

When an event happens. All cases of the tracks use `on_proximity`. A field with a default may be left out.

{_triggers()}

## Programs

A case of the tracks is one trigger with one change: nothing happens in Base, and the change in Dynamic. A
*program* says more: any arms, each a schedule of entries that happen one after another. An entry has a
`trigger`, and either a `change` or the index of an earlier entry that it `reverts`: what that one changed
is as it was before. A case carries its program under `program`, beside `scenario`; its manifest then has
`"manifest_format": 2`. A file with a program alone (JSON or TOML) is laid over the cases of a run by
`--libero-max-program=FILE`:

```json
{_program()}
```

- `"event"` is the trigger, or the change, of the case's own event. Inside a trigger or a change,
  `{{"event": FIELD}}` is a field of that trigger or change, or else of the other:
  `{{"type": "after_grasp", "value": {{"event": "value"}}}}` waits for the grasp of the
  entity that the event's own trigger names.
- `base` and `dynamic` are part of every program. Where they are not spelled out they are those of the case.
  Nothing may happen in `base`. Rates, outcomes and gates are those of `base` and `dynamic`; further arms are
  in the records.
- `strength` beside a `change` is the share of it that happens, above 0, at most 1. `times` makes an entry as
  many entries, one after another; an index counts each.
- `{{"drawn": [LEAST, MOST]}}` in a trigger, for example as its `steps`, is a whole number between the two,
  drawn from the seed of the case's event and the index of the entry: another in every case, and the same in
  every run.
- An arm other than these two may have a `repetition` above 0, to share nothing with the others, and a
  `cadence`, at which it is played: `query_interval` (Q, the executed actions) and `horizon` (H, the chunk
  size). A `latency` is the time that its queries take, `"4steps"` or `"4steps,sync"`
  ([meaning](../explanation/studies.md)). A `policy` is the name of an installed one (`expert`, or an entry
  point; programs name no file), which goes on from the arm's first entry: the executed prefix and what is
  queued of it are those of the run's policy, so that several controllers go on from one proved state. Its
  first query is that at which the run's policy would be asked; with `at_once` it is asked where it goes on,
  and its answer replaces the queue. It begins without a memory, and is given what was executed and queued.
- Arms that differ from Base and Dynamic in cadence, latency or policy alone are reported as
  [settings](../explanation/studies.md), the others by event.
- `about` says what the program plays. `only` and `without` say which cases it fits, by patterns of `event`,
  `operation` (of its change), `suite` and `entity` (of its trigger), and `because` why; a run leaves the
  others out and says so.
- The name of the program ends the ids of the test items, its digest is in the run's header, and the digest of
  each case covers it: a run is not resumed, merged or compared with one of another program.

These come with the package, for `--libero-max-program=NAME`; `libero-max list programs NAME` shows the arms:

{_programs()}
"""


def _programs() -> str:
    return table(
        ("Program", "What is played", "Cases"),
        [
            (f"`{name}`", program.about, program.because or "all")
            for name in program_names()
            for program in (find_program(name),)
        ],
    )


def _program() -> str:
    """An example: the event ends after a second, and a third arm has it before the first query."""
    program = {
        "name": "transient",
        "arms": [
            {
                "name": "dynamic",
                "schedule": [
                    {"trigger": "event", "change": "event"},
                    {"trigger": {"type": "steps_after", "steps": 20}, "reverts": 0},
                ],
            },
            {"name": "reset", "schedule": [{"trigger": {"type": "at_start"}, "change": "event"}]},
        ],
    }
    parse_program(program)
    return json.dumps(program, indent=2)


def _kind(kind: EventKind, examples: dict[tuple[str, int], Case]) -> str:
    module = import_module(type(kind).__module__)
    rows = [
        ("Family", f"{kind.family} (`{kind.code}` in manifests)"),
        ("Severity", f"{kind.severities[0]} (variant 0), {kind.severities[1]} (variant 1)"),
        ("The task needs", kind.needs),
        ("A policy is expected to", f"{kind.expected} (`{kind.response}`)"),
        *_numbers(module),
    ]
    found = [(variant, examples.get((kind.name, variant))) for variant in (0, 1)]
    shown = "".join(_example(variant, case) for variant, case in found if case is not None)
    return f"## {kind.name}\n\n{prose(description(type(kind)))}\n\n{table(('', ''), rows)}\n\n{shown}"


def _numbers(module: ModuleType) -> list[tuple[str, str]]:
    return [(code(item.name), f"`{item.value}`. {one_line(item.text)}") for item in constants(module)]


def _example(variant: int, case: Case) -> str:
    change = _spelled(case.event.change)
    return f"Variant {variant}, in `{case.item_id}`:\n\n```json\n{change}\n```\n\n"


def _spelled(change: Json) -> str:
    """JSON with one line for each parameter, and for each item of a list of objects."""
    lines = []
    for name, value in change.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            value_text = "[\n    " + ",\n    ".join(map(json.dumps, value)) + "\n  ]"
        else:
            value_text = json.dumps(value)
        lines.append(f"  {json.dumps(name)}: {value_text}")
    return "{\n" + ",\n".join(lines) + "\n}"


def _examples() -> dict[tuple[str, int], Case]:
    """The first case of each event and variant, by item id."""
    found: dict[tuple[str, int], Case] = {}
    for case in sorted(load_track(EXAMPLES).cases, key=lambda case: case.item_id):
        found.setdefault((case.event.name, case.event.variant), case)
    return found


def _triggers() -> str:
    rows = []
    for name, trigger in triggers.TRIGGERS.items():
        parameters = " ".join(
            f"`{trigger.spelling.get(field, field)}`: {text}"
            for field, text in section(trigger, "Attributes").items()
        )
        rows.append((code(name), one_line(description(trigger)), one_line(parameters) or "none"))
    return table(("Type", "Fires at", "Parameters"), rows)
