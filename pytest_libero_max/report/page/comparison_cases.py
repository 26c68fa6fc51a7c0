"""Data of the table of cases of a comparison: the common cases, and their outcomes in every run."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import OUTCOMES
from pytest_libero_max.pairing.record_rules import CONTROL_HZ
from pytest_libero_max.report.comparison.compare import CommonCases, outcome_codes
from pytest_libero_max.report.page.case_table import ORDER, again, label_column, label_columns, timeline_of
from pytest_libero_max.report.plots import OUTCOME_TITLES
from pytest_libero_max.runs.media import films_in
from pytest_libero_max.runs.store import pairs_file, read_pairs

_CHANGED = ("yes", "no")


def comparison_cases(
    common: CommonCases, names: Mapping[str, str], replays: Mapping[str, Sequence[str]], beside: Json
) -> Json:
    """Return the data of the table of cases of a comparison, in the form of that of a run.

    The cases that the last run loses come first.

    Args:
        replays: The command that plays a case of a run again, once its item id is appended, by run.
    """
    codes = {run: outcome_codes(pairs).tolist() for run, pairs in common.pairs.items()}
    order = sorted(
        range(len(common.planned)),
        key=lambda index: (
            [ORDER.index(OUTCOMES[of_run[index]]) for of_run in reversed(codes.values())],
            common.planned[index].item_id,
        ),
    )
    planned = [common.planned[index] for index in order]
    outcomes = {run: [OUTCOMES[of_run[index]] for index in order] for run, of_run in codes.items()}
    stale = {run: pairs.stale[order].tolist() for run, pairs in common.pairs.items()}
    changed = [_CHANGED[len(set(case)) == 1] for case in zip(*outcomes.values(), strict=True)]
    columns = [
        *label_columns(planned),
        {**label_column("changed", "Changed", changed, _CHANGED), "shown": False},
    ]
    for number, (run, found) in enumerate(outcomes.items(), start=1):
        column = label_column(f"run{number}", names[run], found, ORDER, OUTCOME_TITLES)
        columns.append({**column, "outcome": True})
    details = [
        {
            "tables": {
                "Runs": {names[run]: _of_run(outcomes[run][place], stale[run][place]) for run in outcomes}
            }
        }
        for place in range(len(planned))
    ]
    films = {
        str(place): [
            [names[run], paths[pair.item_id]]
            for run, paths in beside["films"].items()
            if pair.item_id in paths
        ]
        for place, pair in enumerate(planned)
    }
    for place, pair in enumerate(planned):
        if filmed := {
            names[run]: of[pair.item_id] for run, of in beside["moments"].items() if pair.item_id in of
        }:
            details[place]["timeline"] = _together(filmed)
    return {
        "items": [pair.item_id for pair in planned],
        "columns": columns,
        "case_ids": [pair.case_id for pair in planned],
        "details": details,
        "films": {place: found for place, found in films.items() if found},
        "hz": beside["hz"],
        "commands": [
            again(f"Play it again as in {names[run]}", words, ":") for run, words in replays.items()
        ],
        "pages": [[names[run], page] for run, page in beside["pages"].items()],
        "start": {"changed": _CHANGED[0]} if _CHANGED[0] in changed else {},
    }


def beside(runs: Mapping[str, Path], folder: Path) -> Json:
    """Return the films and pages that lie with the runs, for the page of their comparison.

    Returns:
        ``films``: addresses relative to the page by run and item id. ``moments``: of the pairs with a film,
        see :func:`~pytest_libero_max.report.page.case_table.timeline_of`, by run and item id. ``pages``: the
        address of the page of each run that has one. ``hz``: policy steps in a second of the films.
    """
    filmed = {name: films_in(path) for name, path in runs.items()}
    addresses = {name: quote(Path(os.path.relpath(path, folder)).as_posix()) for name, path in runs.items()}
    records = {
        name: read_pairs(path).records
        for name, path in runs.items()
        if filmed[name] and pairs_file(path).is_file()
    }
    return {
        "hz": next((record.control_hz for of_run in records.values() for record in of_run), CONTROL_HZ),
        "films": {
            name: {item: f"{addresses[name]}/{quote(film)}" for item, film in films.items()}
            for name, films in filmed.items()
        },
        "moments": {
            name: {record.item_id: timeline_of(record) for record in of_run if record.item_id in filmed[name]}
            for name, of_run in records.items()
        },
        "pages": {
            name: f"{addresses[name]}/report.html"
            for name, path in runs.items()
            if (path / "report.html").is_file()
        },
    }


def _together(moments: Mapping[str, Json]) -> Json:
    """Return the moments of a case in several runs as one timeline, whose arms are named by run as well."""
    arms: Json = {}
    for run, timeline in moments.items():
        arms |= {f"{run}, {name}": arm for name, arm in timeline["arms"].items()}
    return {"steps": max(timeline["steps"] for timeline in moments.values()), "arms": arms}


def _of_run(outcome: str, stale: int) -> dict[str, Any]:
    return {"outcome": OUTCOME_TITLES[outcome], "stale actions": None if stale < 0 else stale}
