"""The tables for a paper, compared digit for digit with those that the LIBERO-MAX paper prints."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.releases import RELEASED
from pytest_libero_max.cli import main
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, EVENTS
from pytest_libero_max.lab.comparisons.paper_files import write_tables
from pytest_libero_max.lab.comparisons.paper_plots import PAPER_PLOTS
from pytest_libero_max.lab.comparisons.paper_rows import PolicyRow, published_row, row_of
from pytest_libero_max.lab.comparisons.paper_tables import paper_tables, partial_tables
from pytest_libero_max.report.document import Table
from pytest_libero_max.report.published import (
    authors_cases,
    lacks_for_published,
    published_partial,
    published_policies,
)
from pytest_libero_max.report.render.drawing import drawn
from pytest_libero_max.report.render.markdown import table_markdown
from pytest_libero_max.report.render.tables import table_csv, table_latex
from pytest_libero_max.runs.outcomes import Played, RunOutcomes
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.stats.paired import Pairs
from tests.report.made_up import POLICY, PROVENANCE, plan, record_of
from tests.report.svg_frame import parsed_inside

FACTS = (
    Path(os.environ.get("LIBERO_MAX_FACTS", Path(__file__).parents[4] / "shared" / "facts")) / "paper.json"
)
"""All values that the paper prints, beside the checkout; the tests that need them skip without them."""

TABLES: Json = json.loads((Path(__file__).parents[2] / "stats" / "paper_tables.json").read_text())

PUBLISHED = [published_row(policy) for policy in published_policies()]
KEYS = [policy.key for policy in published_policies()]


@cache
def _facts() -> Json:
    if not FACTS.exists():
        pytest.skip(f"{FACTS} is not here")
    facts: Json = json.loads(FACTS.read_text(encoding="utf-8"))
    return facts


def _cells(rows: Sequence[PolicyRow], stem: str) -> list[list[str]]:
    """The cells of a table's Markdown."""
    (table,) = [table for table in paper_tables(rows) if table.key == stem]
    return _rows(table)


def _rows(table: Table) -> list[list[str]]:
    lines = [line for line in table_markdown(table).splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "---" not in line]


def _signed(value: float) -> str:
    return f"{value:+.1f}"


def _plain(value: float) -> str:
    return f"{value:.1f}"


FAMILIES = {
    "geometry": "delta_geometry",
    "observation": "delta_observation",
    "appearance and clutter": "delta_appearance_clutter",
    "path constraint": "delta_path",
}


def _main(key: str) -> dict[str, str]:
    row = _facts()["main_table"]["rows"][key]
    return {
        "Base": _plain(row["base_sr"]),
        "Dynamic": _plain(row["dynamic_sr"]),
        "Change": _signed(row["delta"]),
        **{title: _signed(row[name]) for title, name in FAMILIES.items()},
    }


def _outcomes(key: str) -> dict[str, str]:
    row = _facts()["paired_outcomes"]["rows"][key]
    titles = ("Preserved (1,1)", "Gained (0,1)", "Regressed (1,0)", "Failed (0,0)", "Pairs")
    return dict(zip(titles, map(str, row.values()), strict=True))


def _events(key: str) -> dict[str, str]:
    row = _facts()["event_deltas"]["rows"][key]
    return {event.replace("_", " "): _signed(change) for event, change in row.items()}


def _rates(title: str, row: Mapping[str, float], prefix: str = "") -> dict[str, str]:
    return {
        f"{title} Base": _plain(row[f"{prefix}base"]),
        f"{title} Dynamic": _plain(row[f"{prefix}dynamic"]),
        f"{title} change": _signed(row[f"{prefix}gap"]),
    }


def _sources(key: str) -> dict[str, str]:
    row = _facts()["source_subsets"]["rows"][key]
    return _rates("plus", row["plus"]) | _rates("pro", row["pro"])


def _suites(key: str) -> dict[str, str]:
    row = _facts()["factorized"]["suites_and_macro"]["rows"][key]
    return {
        "Macro" if name == "category_macro" else name.replace("_", " "): _signed(change)
        for name, change in row.items()
    }


def _severity(key: str) -> dict[str, str]:
    row = _facts()["factorized"]["severity_and_split"]["rows"][key]
    return {
        "medium": _signed(row["medium"]),
        "high": _signed(row["high"]),
        "Largest split": _plain(row["split_pp"]),
        "Event of it": row["largest_split_event"].replace("_", " "),
    }


def _lite(key: str) -> dict[str, str]:
    row = _facts()["lite_validation"]["rows"][key]
    return _rates("Max", row, "max_") | _rates("Lite", row, "lite_")


def _policies(key: str) -> dict[str, str]:
    row, play = _facts()["policies"]["rows"][key], _facts()["execution_protocols"]["rows"][key]
    scale = row["reported_scale"]
    return {
        "Kind": row["family"],
        "Reported scale": "--" if scale == "Not reported" else scale,
        "H": str(play["H"]),
        "Q": str(play["Q"]),
    }


PRINTED: Mapping[str, Callable[[str], dict[str, str]]] = {
    "policies": _policies,
    "main": _main,
    "outcomes": _outcomes,
    "events": _events,
    "sources": _sources,
    "suites": _suites,
    "severity": _severity,
    "lite": _lite,
}


@pytest.mark.parametrize("stem", PRINTED)
def test_the_published_rows_are_the_papers_digit_for_digit(stem: str) -> None:
    head, *rows = _cells(PUBLISHED, stem)
    assert len(rows) == 14
    for key, row in zip(KEYS, rows, strict=True):
        expected = PRINTED[stem](key)
        shown = dict(zip(head, row, strict=True))
        assert {title: shown[title] for title in expected} == expected, key


def test_lite_keeps_the_order_of_as_many_policies_as_the_paper_says() -> None:
    said = _facts()["lite_validation"]["statements"]
    (table,) = [table for table in paper_tables(PUBLISHED) if table.key == "lite"]
    assert f"Largest difference {said['largest_absolute_deviation_pp']}." in table.note
    assert f"{said['orderings_preserved']} of {said['orderings_total']} orders" in table.note


def test_the_partial_policy_is_the_papers_digit_for_digit() -> None:
    printed = _facts()["mimic_video_partial"]["rows"]
    (table,) = partial_tables([], published_partial())
    _, *rows = _rows(table)
    assert len(rows) == 5
    for _, _, suite, *cells in rows:
        row = printed["supported_total" if suite == "all supported" else suite]
        if row["base_sr"] is None:
            assert cells[1:] == ["--"] * 3
        else:
            rates = [_plain(row["base_sr"]), _plain(row["dynamic_sr"]), _signed(row["gap"])]
            assert cells == [str(row["pairs"]), *rates]
    assert authors_cases() == {name: row["pairs"] for name, row in printed.items() if "libero" in name}


CASES = [
    PlannedPair(
        case_id=f"c{index:04d}",
        item_id=f"c{index:04d}",
        case_digest="0" * 64,
        source="plus" if index % 10 < 7 else "pro",
        source_category=f"category {index % 10}",
        difficulty=None,
        suite="libero_goal",
        event=event,
        family=EVENTS[event].family,
        variant=index % 2,
        severity=EVENTS[event].severities[index % 2],
        task=f"libero_goal/{index % 10}",
    )
    for index, event in enumerate(np.repeat(BENCHMARK_EVENTS, 1000).tolist())
]
"""A thousand cases of each event."""


def _counted(policy: Any) -> Pairs:
    """Outcomes of 8,000 cases with the published counts, in all and by event."""
    base, dynamic = np.zeros(8000, dtype=np.bool_), np.zeros(8000, dtype=np.bool_)
    counts, gains = policy.outcomes, _dealt(policy)
    for number, event in enumerate(BENCHMARK_EVENTS):
        start = 1000 * number
        gained, lost = gains[event], gains[event] - policy.net_change[event]
        base[start : start + lost] = True
        dynamic[start + lost : start + lost + gained] = True
    same = np.flatnonzero(~(base | dynamic))[: counts.preserved_success]
    base[same] = dynamic[same] = True
    return Pairs.of(
        base=base, dynamic=dynamic, triggered=[True] * 8000, responded=[True] * 8000, stale=[0] * 8000,
        source=[case.source for case in CASES], task=[case.task for case in CASES],
    )  # fmt: skip


def _dealt(policy: Any) -> dict[str, int]:
    """Gained pairs by event: as few as the changes need, the others where there is room."""
    gains = {event: max(net, 0) for event, net in policy.net_change.items()}
    left = policy.outcomes.change_associated_success - sum(gains.values())
    assert left >= 0
    for event, net in policy.net_change.items():
        room = min(left, (1000 - 2 * gains[event] + net) // 2)
        gains[event], left = gains[event] + room, left - room
    assert left == 0
    return gains


def test_runs_with_the_published_counts_give_the_papers_main_tables() -> None:
    """Of 15 exact ties among the family changes the paper rounds two towards zero; these tables do not."""
    rows = [row_of(p.name, POLICY, CASES, _counted(p), frozenset()) for p in published_policies()]
    assert [row.outcomes for row in rows] == [policy.outcomes for policy in published_policies()]
    ties = {("smolvla", "geometry"): "-21.3", ("dit4dit", "geometry"): "-26.7"}
    for key, row in zip(KEYS, _cells(rows, "main")[1:], strict=True):
        base, dynamic, change = TABLES["main"][key]
        printed = [_plain(base), _plain(dynamic), _signed(change)]
        printed += [ties.get((key, name), _signed(value)) for name, value in TABLES["families"][key].items()]
        assert [*row[1:4], *row[5:]] == printed, key
    for policy, row in zip(published_policies(), _cells(rows, "events")[1:], strict=True):
        assert row[1:] == [_signed(net / 10) for net in policy.net_change.values()]


def _runs(count: int, **provenance: Json) -> dict[str, RunOutcomes]:
    """Runs of 64 made-up pairs."""
    pairs = plan(per_cell=2)
    draw = np.random.default_rng(3)
    return {
        f"runs/{name}": RunOutcomes(
            run=Run(tuple(pairs), {**PROVENANCE, **provenance}),
            case_ids=tuple(pair.case_id for pair in pairs),
            pairs=Pairs.of(
                base=draw.random(64) < 0.8, dynamic=draw.random(64) < 0.5, triggered=[True] * 64,
                responded=[True] * 60 + [False] * 4, stale=[1] * 64,
                source=[pair.source for pair in pairs], task=[pair.task for pair in pairs],
            ),
            policy={**POLICY, "name": f"policy & {name}"},
            scenes=("",) * 64,
            renderers=(),
            played=tuple(Played.of(record_of(pair, True, True)) for pair in pairs),
        )
        for name in range(count)
    }  # fmt: skip


@pytest.mark.parametrize("count", [1, 2, 6])
def test_all_files_are_written_for_any_number_of_runs(count: int, tmp_path: Path) -> None:
    written = write_tables(_runs(count), tmp_path / "out")
    names = {path.name for path in written}
    stems = {
        "policies",
        "main",
        "outcomes",
        "retained",
        "events",
        "sources",
        "categories",
        "suites",
        "severity",
    }
    assert {f"{stem}.{end}" for stem in stems for end in ("csv", "tex")} < names
    assert "lite.csv" not in names, "smoke is no part of Max"
    assert {"tables.md", "policy-arrows.svg", "coverage.svg", "categories.svg"} < names
    assert ("event-changes.svg" in names) == (count > 1)
    text = (tmp_path / "out" / "tables.md").read_text()
    assert "not comparable" in text
    assert all(f"]({name})" in text for name in names if name.endswith(".svg"))
    rows = list(csv.DictReader(io.StringIO((tmp_path / "out" / "main.csv").read_text())))
    assert len(rows) == count
    lower, change, upper = (float(rows[0][f"paired_change{end}"]) for end in ("_lower", "", "_upper"))
    assert 0 <= float(rows[0]["base_success"]) <= 1
    assert lower < change < upper


def test_latex_is_escaped_and_has_as_many_cells_as_headings(tmp_path: Path) -> None:
    rows = [row_of("a & b_c", POLICY, CASES, _counted(published_policies()[0]), frozenset()), *PUBLISHED]
    for table in paper_tables(rows):
        text = table_latex(table, [table.title, *([table.note] if table.note else [])])
        assert r"a \& b\_c &" in text
        body = [line.replace(r"\&", "") for line in text.splitlines() if line.endswith(r" \\")]
        assert len(body) == 16
        assert {line.count("&") for line in body} == {len(table.head) - 1}
        assert text.splitlines().count(r"\hline") == 4, "the results of the paper stand apart"


def test_published_rows_are_marked_beside_others() -> None:
    own = row_of("mine", POLICY, CASES, _counted(published_policies()[0]), frozenset())
    (table, *_) = [table for table in paper_tables([own, *PUBLISHED]) if table.key == "main"]
    names = [row[0] for row in _rows(table)[1:]]
    assert names[:2] == ["mine", "pi_0.5"]
    rows = [*csv.DictReader(io.StringIO(table_csv(table)))]
    assert [row["from"] for row in rows] == ["run", *["paper"] * len(PUBLISHED)]


MAX = next(file for file in RELEASED if file.file == "libero_max_8000.json")
OFFICIAL: Json = {
    **PROVENANCE,
    "case_set": {"name": "manifest libero_max_8000.json", "digest": "0" * 64, "released_as": str(MAX)},
    "substrate": {
        "name": "libero",
        "semantics": "published",
        "instruction_source": "published",
        "source_variations": "installed",
    },
}


@pytest.mark.parametrize(
    ("changed", "played", "said"),
    [
        ({}, 8000, None),
        ({}, 7999, "it has 7,999 of the 8,000 cases"),
        ({"case_set": {"name": "track genuine/max"}}, 8000, "its cases are track genuine/max"),
        (
            {"case_set": {"name": "m", "released_as": f"like {MAX}, but NOT that file"}},
            8000,
            "its cases are m",
        ),
        ({"substrate": {**OFFICIAL["substrate"], "semantics": "corrected"}}, 8000, "its semantics are not"),
        ({"protocol": {"prefix": "fork", "latency": "4steps"}}, 8000, r"another protocol (latency)"),
    ],
)
def test_published_results_stand_beside_runs_of_the_same_cases_alone(
    changed: Json, played: int, said: str | None
) -> None:
    lack = lacks_for_published({**OFFICIAL, **changed}, played)
    assert (lack is None) if said is None else (lack is not None and said in lack)


def test_published_results_are_refused_beside_other_runs(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match=r"runs/0: .* embedded"):
        write_tables(_runs(1), tmp_path, published=True)
    with pytest.raises(ReportError, match="No run"):
        write_tables({}, tmp_path)


def test_a_partial_run_is_in_a_table_of_its_own(tmp_path: Path) -> None:
    runs = _runs(3)
    partial = {**POLICY, "name": "partial", "suites": ["libero_spatial"]}
    runs["runs/2"] = replace(runs["runs/2"], policy=partial)
    write_tables(runs, tmp_path)
    assert "partial" not in (tmp_path / "main.csv").read_text()
    rows = list(csv.DictReader(io.StringIO((tmp_path / "partial.csv").read_text())))
    assert [(row["suite"], row["pairs"]) for row in rows] == [
        ("libero_object", ""),
        ("libero_spatial", "32"),
        ("all supported", "32"),
    ]


@pytest.mark.parametrize("figure", PAPER_PLOTS)
@pytest.mark.parametrize("rows", [PUBLISHED, None], ids=["published", "own"])
def test_figures_are_well_formed_and_inside_their_frames(figure: str, rows: list[PolicyRow] | None) -> None:
    own = [row_of(p.name, POLICY, CASES, _counted(p), frozenset()) for p in published_policies()[:3]]
    plot = PAPER_PLOTS[figure][0](own if rows is None else rows)
    assert (plot is None) == (rows is not None and figure == "categories"), "nothing is published by category"
    if plot is not None:
        parsed_inside(drawn(plot))


def test_the_command_writes_the_published_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "--published", "--tables", str(tmp_path / "tables")]) == 0
    assert "tables.md, and" in capsys.readouterr().out
    assert "| pi_0.5 | paper | 79.7 | 65.7 | -13.9 |" in (tmp_path / "tables" / "tables.md").read_text()
    assert main(["compare", "--published"]) != 0
    assert "Give --tables as well" in capsys.readouterr().err
