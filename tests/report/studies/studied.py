"""Made-up records of studies: cases with a given outcome in every arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from msgspec.structs import replace

from pytest_libero_max.benchmark.documents import Json, canonical_digest
from pytest_libero_max.pairing.record import ArmRecord, FiringRecord, PairRecord
from pytest_libero_max.runs.plan import PlannedPair
from tests.report.made_up import POLICY, PROVENANCE, record_of

SCHEDULE = {
    "trigger": {"type": "on_proximity", "value": "bowl_1", "distance_m": 0.18},
    "change": {"operation": "shift_camera"},
}


@dataclass(frozen=True)
class Cell:
    """Cases of one source that ended alike.

    Attributes:
        source: Their source.
        success: Whether each arm succeeded, by name.
        count: How many.
        near: Whether the hand came within the trigger's distance in Reset.
        stale: Stale actions in Dynamic.
    """

    source: str
    success: Mapping[str, bool]
    count: int
    near: bool = True
    stale: int = 2


def cell(source: str, outcomes: str, count: int, near: bool = True, stale: int = 2) -> Cell:
    """Cases that ended so in Base, Reset and Mid-task: ``101`` fails in Reset alone."""
    base, reset, middle = (letter == "1" for letter in outcomes)
    return Cell(source, {"base": base, "reset": reset, "dynamic": middle}, count, near, stale)


# X-VLA. The marginals of each source, the 2 and 106 discordant cases and the approaches of Reset are printed;
# that the 7 cases that only Mid-task solves are of plus is not, and moves no printed decimal.


def study_of(cells: Sequence[Cell], header: Json) -> tuple[list[PlannedPair], list[PairRecord], Json]:
    """Plan, records and provenance of a run of a study."""
    planned: list[PlannedPair] = []
    records: list[PairRecord] = []
    for cell in cells:
        for _ in range(cell.count):
            pair = _planned(cell.source, len(planned))
            planned.append(pair)
            records.append(_record(pair, cell))
    return planned, records, {**PROVENANCE, "protocol": {"prefix": "fork", "study": header}}


def _planned(source: str, number: int) -> PlannedPair:
    name = f"{source}-t{number:04d}-camera_shift-v0"
    return PlannedPair(
        case_id=name,
        item_id=name,
        case_digest=canonical_digest(name),
        source=source,
        source_category="Camera Viewpoints" if source == "plus" else "Position",
        difficulty=None,
        suite="libero_spatial",
        event="camera_shift",
        family="observation",
        variant=0,
        severity="high",
        task=f"libero_spatial/{number % 40}",
    )


def _record(pair: PlannedPair, cell: Cell) -> PairRecord:
    values = cell.success
    record = record_of(pair, values["base"], values["dynamic"], policy=POLICY)
    base, dynamic = record.arms["base"], record.arms["dynamic"]
    firing = dynamic.firings[0]
    dynamic = replace(
        dynamic, schedule=(SCHEDULE,), stale_actions=cell.stale, response_step=firing.step + cell.stale
    )
    arms: dict[str, ArmRecord] = {"base": replace(base, schedule=()), "dynamic": dynamic}
    for name, success in values.items():
        if name in arms:
            continue
        if name.startswith("reset"):
            arms[name] = _reset(base, firing, success, cell.near)
        else:
            template = arms["dynamic" if name.startswith("dynamic") else "base"]
            arms[name] = replace(template, success=success)
    return replace(record, arms=arms, task_index=int(pair.item_id.split("-t")[1][:4]))


def _reset(base: ArmRecord, firing: FiringRecord, success: bool, near: bool) -> ArmRecord:
    at_start: dict[str, Any] = {"trigger": {"type": "at_start"}, "change": SCHEDULE["change"]}
    return replace(
        base,
        success=success,
        schedule=(at_start,),
        firings=(replace(firing, step=0, queries=0),),
        response_step=0,
        stale_actions=0,
        min_distance_m=0.05 if near else 0.31,
    )
