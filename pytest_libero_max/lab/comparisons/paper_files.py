"""The files of the tables for a paper: Markdown with figures, and each table as CSV and LaTeX."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePath

from pytest_libero_max.benchmark.tracks import GENUINE, load_track
from pytest_libero_max.errors import ReportError
from pytest_libero_max.lab.comparisons.paper_plots import PAPER_PLOTS
from pytest_libero_max.lab.comparisons.paper_rows import PolicyRow, published_row, row_of
from pytest_libero_max.lab.comparisons.paper_tables import paper_tables, partial_tables
from pytest_libero_max.report.build import substrate_of
from pytest_libero_max.report.comparison.compare import (
    apart_run,
    compare_runs,
    compared_and_apart,
    lined_up,
    notes_of,
)
from pytest_libero_max.report.comparison.compare_files import COMPARISON_CAPTIONS, comparison_figures
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.comparison_sections import difference_warnings, left_out_text
from pytest_libero_max.report.document import Document, Section
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.published import (
    NOTE,
    lacks_for_published,
    published_partial,
    published_policies,
)
from pytest_libero_max.report.render.drawing import drawn
from pytest_libero_max.report.render.markdown import document_markdown
from pytest_libero_max.report.render.tables import table_files
from pytest_libero_max.report.statements import STATEMENTS
from pytest_libero_max.report.writers.report_files import make_folder, write_drawings, write_text
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.stats.paired import measure_groups

MARKDOWN_NAME = "tables.md"


def write_tables(
    runs: Mapping[str, RunOutcomes], folder: Path, restrict: bool = False, published: bool = False
) -> list[Path]:
    """Write the tables and figures that the paper prints, for any runs.

    Args:
        runs: Runs by name; none for the published results alone.
        folder: Made where it is missing.
        restrict: Use the common cases where the runs differ, instead of refusing.
        published: Add the fourteen published policies below the runs.

    Returns:
        ``tables.md``, a CSV and a LaTeX file for each table, and the figures.

    Raises:
        ReportError: There is nothing to show, the runs have no cases in common or cannot be in one table with
            published results, or the files cannot be written.
    """
    if not runs and not published:
        raise ReportError("No run is given. Give the folders of runs, or ask for the published results.")
    compared, apart = compared_and_apart(runs, restrict)
    if published:
        _require_published_cases(runs)
    rows: list[PolicyRow] = []
    figures: dict[str, str] = {}
    notes = [NOTE] if published else []
    captions = {stem: caption for stem, (_, caption) in PAPER_PLOTS.items()}
    title = "Published results"
    if compared:
        own, comparison, own_notes = _own(compared, restrict)
        rows += own
        notes += own_notes
        title = f"Tables over {counted(own[0].outcomes.total, 'case')} of {_case_set(compared)}"
        if comparison is not None:
            figures |= comparison_figures(comparison)
            captions |= COMPARISON_CAPTIONS
    if published:
        rows += [published_row(policy) for policy in published_policies()]
    figures |= {stem: drawn(plot) for stem, (of, _) in PAPER_PLOTS.items() if (plot := of(rows)) is not None}
    partial = [apart_run(name, run) for name, run in apart.items()]
    tables = [*paper_tables(rows), *partial_tables(partial, published_partial() if published else None)]
    document = Document(
        title,
        texts=notes,
        sections=[Section(tables=[table]) for table in tables],
        statements=[*STATEMENTS.values()],
    )
    files = {MARKDOWN_NAME: document_markdown(document, {stem: captions[stem] for stem in figures})}
    files |= table_files(document)
    make_folder(folder)
    for name, content in files.items():
        write_text(folder / name, content)
    return [*(folder / name for name in files), *write_drawings(figures, folder)]


def _own(
    runs: Mapping[str, RunOutcomes], restrict: bool
) -> tuple[list[PolicyRow], Comparison | None, list[str]]:
    """Return the rows of runs on their common cases, their comparison if they are several, and notes."""
    common = lined_up(runs, restrict)
    comparison = compare_runs(runs, restrict) if len(runs) > 1 else None
    lite = _lite_cases(_case_set(runs)) & {pair.case_id for pair in common.planned}
    names = _names(runs)
    rows = [
        replace(
            row_of(names[name], runs[name].policy, common.planned, pairs, lite),
            with_interval=not runs[name].stopped_by_rule,
        )
        for name, pairs in common.pairs.items()
    ]
    substrate = substrate_of(next(iter(runs.values())).run.provenance, common.planned)
    notes = [substrate.note] if substrate.note else []
    left_out = {names[name]: cases for name, cases in common.left_out.items()}
    notes += left_out_text(len(common.planned), left_out)
    if comparison is not None:
        notes += difference_warnings(comparison.differences)
    case_ids = {pair.case_id for pair in common.planned}
    notes += [
        text
        for name, result in zip(common.pairs, measure_groups(list(common.pairs.values())), strict=True)
        for text in notes_of(names[name], runs[name], result, case_ids)
    ]
    return rows, comparison, notes


def _names(runs: Mapping[str, RunOutcomes]) -> dict[str, str]:
    """Return a name for each run: that of its policy, with the run where several runs have the same."""
    policies = {name: str((run.policy or {}).get("name", name)) for name, run in runs.items()}
    several = {policy for policy, count in Counter(policies.values()).items() if count > 1}
    short = {name: PurePath(name).name for name in runs}
    if len({*short.values()}) < len(short):
        short = {name: name for name in runs}
    return {
        name: f"{policy} ({short[name]})" if policy in several else policy
        for name, policy in policies.items()
    }


def _case_set(runs: Mapping[str, RunOutcomes]) -> str:
    return str(next(iter(runs.values())).run.provenance["case_set"]["name"])


def _lite_cases(case_set: str) -> frozenset[str]:
    """Return the ids of the cases of Lite for a run of Max; none for another case set."""
    tracks = {"track max": "lite", f"track {GENUINE}/max": f"{GENUINE}/lite"}
    if case_set not in tracks:
        return frozenset()
    return frozenset(case.case_id for case in load_track(tracks[case_set]).cases)


def _require_published_cases(runs: Mapping[str, RunOutcomes]) -> None:
    for name, run in runs.items():
        lack = lacks_for_published(run.run.provenance, len(run.case_ids))
        if lack is not None:
            raise ReportError(
                f"Published results cannot be in one table with {name}: {lack}. Leave --published out, or "
                "give it without a run."
            )
