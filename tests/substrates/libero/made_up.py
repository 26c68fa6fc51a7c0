"""Cases that no manifest has, from one that there is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.tracks import load_track


def case_of(category: str | None, suite: str, index: int, **changes: Any) -> Case:
    """The first case of the original track that needs no setup, with another task and source.

    Args:
        category: As a manifest spells it, ``LIBERO-PRO/task`` for example; None for an unmodified task.
        suite: LIBERO suite.
        index: Index of the task in its source's registry.
        changes: Fields of the record to add or replace.
    """
    own = {"substrate_category", "substrate_difficulty", "substrate_variant", "task_name"}
    first = next(case for case in load_track("original") if not case.event.setup)
    record = {key: value for key, value in first.record.items() if key not in own}
    record |= {"task_suite_name": suite, "task_index": index, "init_state_index": 0, "policy_seed": 195}
    record["case_id"] = f"{category or 'plain'}-{suite}-{index}".replace(" ", "-")
    if category is not None:
        record["substrate_category"] = category
    return parse_case(record | changes)


def pro_case(category: str, suite: str, index: int, **changes: Any) -> Case:
    """A case of LIBERO-PRO."""
    return case_of(f"LIBERO-PRO/{category}", suite, index, **changes)


def manifest_of(path: Path, *cases: Case) -> Path:
    """Write cases as a manifest."""
    path.write_text(replace(load_track("original"), benchmark_id="made-up", cases=cases).to_json())
    return path
