"""What belongs beside the numbers of a run wherever they are printed with those of other runs."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from pytest_libero_max.report.caveats import caveat_text, caveats_of
from pytest_libero_max.report.comparison.comparison_document import ApartRun, ComparedRun, Comparison
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.measurable import warning_of
from pytest_libero_max.report.report_document import Caveat
from pytest_libero_max.report.statements import CAVEATS_TITLE
from pytest_libero_max.report.stopping_rule import bias_of
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.stats.blocks import Result


def run_warnings(run: RunOutcomes, result: Result) -> list[str]:
    """Return what keeps the numbers of a run from saying what they seem to: a floor, or its stopping rule."""
    warnings = [warning_of(result)]
    if run.stopped is not None and run.stopped_by_rule:
        warnings.append(
            f"{run.stopped.text}. It has no 95% intervals and no p-values here: these need a number of pairs "
            "that is fixed before the run."
        )
        warnings.append(bias_of(run.stopped))
    return [text for text in warnings if text]


def run_caveats(run: RunOutcomes, cases: Collection[str]) -> list[Caveat]:
    """Return the caveats on the pairs of some cases of a run."""
    return caveats_of(
        played for case_id, played in zip(run.case_ids, run.played, strict=True) if case_id in cases
    )


def notes_of(name: str, run: RunOutcomes, result: Result, cases: Collection[str]) -> list[str]:
    """Return the warnings and the caveats of one run over some cases, each with its name."""
    return [
        *(f"{name}: {text}" for text in run_warnings(run, result)),
        *(f"{name}: {caveat_text(caveat)}" for caveat in run_caveats(run, cases)),
    ]


def warnings_by_run(comparison: Comparison) -> list[str]:
    """Return the warnings of the runs, each with the names of the runs that it is about."""
    return [f"{', '.join(names)}: {text}" for text, names in _by_text(_warnings(comparison)).items()]


def caveats_by_run(comparison: Comparison) -> list[str]:
    """Return the caveats of the runs in full, each with its runs and their numbers of pairs."""
    return [f"{', '.join(names)}: {text}" for text, names in _by_text(_caveats(comparison)).items()]


def caveat_names(comparison: Comparison) -> list[str]:
    """Return for each run that has caveats a line with their keys and numbers of pairs."""
    return [
        f"{CAVEATS_TITLE} of {run.name} (in full in its report.md): "
        + ", ".join(f"{caveat.name} {caveat.pairs}" for caveat in run.caveats)
        for run in _runs(comparison)
        if run.caveats
    ]


def _runs(comparison: Comparison) -> list[ComparedRun | ApartRun]:
    return [*comparison.runs, *comparison.apart]


def _warnings(comparison: Comparison) -> Iterable[tuple[str, str]]:
    return ((text, run.name) for run in _runs(comparison) for text in run.warnings)


def _caveats(comparison: Comparison) -> Iterable[tuple[str, str]]:
    return (
        (caveat.text, f"{caveat.pairs} of {counted(caveat.played, 'pair')} of {run.name}")
        for run in _runs(comparison)
        for caveat in run.caveats
    )


def _by_text(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for text, name in pairs:
        found.setdefault(text, []).append(name)
    return found
