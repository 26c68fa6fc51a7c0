"""The page of the probes: their columns, and what each costs."""

from __future__ import annotations

from typing import Any

from pytest_libero_max.lab.probes.safety import Safety
from pytest_libero_max.lab.sections import monitors
from pytest_libero_max.lab.sections.safety import LIMITS
from pytest_libero_max.pairing import probes
from pytest_libero_max.pairing.probes.monitor import Monitor
from pytest_libero_max.pairing.probes.probe import Probe
from pytest_libero_max.pairing.probes.registry import PROBES
from pytest_libero_max.pairing.probes.standard import STANDARD
from tests.reference.docstrings import description
from tests.reference.markdown import code, one_line, prose, table

OWN = "pytest_libero_max."
"""Begins the names of this package's modules; other packages may have added probes."""


def page() -> str:
    """The text."""
    limits = "\n".join(f"- {meaning.format(limit)}" for limit, meaning in LIMITS.values())
    others = [probe for probe in PROBES.values() if type(probe).__module__.startswith(OWN)]
    return f"""# Probes

{prose(description(probes))}

{prose(description(Probe))}

A probe of your own is a subclass of `Probe` under its name in the entry-point group
`{PROBES.group}`:

```python
from pytest_libero_max import Probe
from pytest_libero_max.probes import Column, View


class Lowest(Probe[float]):
    \"\"\"Lowest height of the hand.\"\"\"

    name = "lowest"
    schema = (Column("height_m", "float", "Lowest height of the end effector", "m"),)
    cost = "nothing to speak of"

    def start(self, view: View) -> float:
        return float(view.world.end_effector()[2])

    def step(self, state: float, view: View) -> float:
        return min(state, float(view.world.end_effector()[2]))

    def columns(self, state: float, view: View) -> dict[str, float]:
        return {{"height_m": state}}
```

## Those of every pair

Their columns are fields of [an arm's record](records.md#armrecord), those of `stages` are in its `probes`.
The rules of a [diagnosis](causes.md) read them.

{_table(STANDARD.standard)}

## Those that are asked for

`--libero-max-probe=NAME` reads one more in every arm. Its columns are in the record's `probes`, by its name;
the means of its numbers are in the reports, by arm.
For each that is asked after every step the world's digest is compared, 0.02 ms on the embedded substrate.

{_table(others)}

## Monitors

{prose(description(Monitor))}

{prose(description(monitors))}

Four baselines come with the package: `action_spread`, `chunk_change`, `image_change`, `scene_distance`
([measured](../../reports/monitors.md)). One of your own is a class under its name in the entry-point group
`{PROBES.group}`:

```python
from pytest_libero_max.probes import Monitor


class Stillness(Monitor[None]):
    \"\"\"How little the policy moves.\"\"\"

    name = "stillness"
    cost = "nothing to speak of"

    def observe(self, memory, observation, actions, step):
        return None, -abs(actions[:, :6]).max()
```

## Successful but unsafe

With `--libero-max-probe=safety` the reports count the rollouts that complete their task beyond one of these
limits, which are those of SafeVLA-Bench (arXiv 2606.00773), and again at half and at twice the limits:

{limits}

{prose(description(Safety))}

What is let go half a centimetre above its place exceeds 0.3 m/s, so that tasks which end over a basket seldom
stay below. The motors of the simulated arm give at most 80 Nm.
"""


def _table(those: tuple[Probe[Any], ...] | list[Probe[Any]]) -> str:
    rows = (
        (
            code(probe.name),
            code(column.name),
            f"list of {column.type}{' or null' if column.optional else ''}"
            if column.many
            else f"{column.type} or null"
            if column.optional
            else column.type,
            column.unit or "",
            one_line(column.meaning),
            one_line(probe.cost),
        )
        for probe in those
        for column in probe.schema
    )
    return table(("Probe", "Column", "Type", "Unit", "Meaning", "Cost"), rows)
