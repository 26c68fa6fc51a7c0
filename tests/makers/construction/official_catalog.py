"""The authors' released task catalogue, read as our metadata."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pytest_libero_max.tasks.contents import InitialPlacement, Relation, TaskMetadata, owner


def metadata_from_catalog(row: Mapping[str, Any]) -> TaskMetadata:
    """Read a row of a released task catalogue; everything that can be derived is derived again."""
    objects, fixtures = dict(row["objects"]), dict(row["fixtures"])
    return TaskMetadata(
        name=row["task_name"],
        language=row["language"],
        objects=objects,
        fixtures=fixtures,
        objects_of_interest=frozenset(row["objects_of_interest"]),
        goal=tuple(Relation(r["predicate"], tuple(r["arguments"])) for r in row["goal_relations"]),
        placements={
            name: InitialPlacement(p["predicate"], p["region"], owner(p["region"], [*objects, *fixtures]))
            for name, p in row["initial_placements"].items()
        },
        reserved=frozenset(row.get("pro_reserved_objects", ())),
    )
