"""Write the table of ``reports/gates.md``: how often gates pass. ``python -m tests.report.gate_table``."""

from __future__ import annotations

from pathlib import Path

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.report.gate_plan import chance_of_passing
from pytest_libero_max.report.gates import parse_gate
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.power import Chances

PAGE = Path(__file__).parents[2] / "reports" / "gates.md"

BASE, CHANCE = 0.9, 0.01
LOSSES = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)
TRACKS = {"smoke": 32, "lite": 800, "max": 8000}
GATES = (
    "delta >= -15%",
    "delta.lower >= -15%",
    "delta.lower >= -5%",
    "delta.clustered.lower >= -15%",
    "dynamic_sr_vs(RUN).lower >= -5%",
    "dynamic_sr_vs(RUN).lower >= -10%",
    "equivalent_vs(RUN, 5%)",
    "equivalent_vs(RUN, 15%)",
    "regressions_vs(RUN) <= 3",
)


def row(gate: str, track: str) -> str:
    """Return a row of the table."""
    parsed, planned = parse_gate(gate), [PlannedPair.of(case) for case in load_track(track)]
    chances = [Chances(BASE, CHANCE + loss, CHANCE) for loss in LOSSES]
    passing = [chance_of_passing(parsed, len(planned), one, planned) for one in chances]
    return f"| `{gate}` | {track} | {' | '.join(f'{100 * value:.1f}%' for value in passing)} |\n"


if __name__ == "__main__":
    rows = "".join(row(gate, track) for gate in GATES for track in TRACKS)
    before, _, rest = PAGE.read_text().partition("| `")
    PAGE.write_text(before + rows + "\n" + rest.partition("\n\n")[2])
