"""The report's breakdowns as CSV for spreadsheets and LaTeX for papers."""

from __future__ import annotations

import csv
import io

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.summary import title_text

CSV_COLUMNS = (
    "dimension",
    "group",
    "planned",
    "played",
    "base_success",
    "base_lower",
    "base_upper",
    "dynamic_success",
    "dynamic_lower",
    "dynamic_upper",
    "paired_change",
    "change_lower",
    "change_upper",
    "preserved_success",
    "change_associated_success",
    "regression",
    "persistent_failure",
    "conditional_regression",
    "trigger_coverage",
    "response_coverage",
    "stale_mean",
    "log10_p_value",
)


def csv_text(report: Json) -> str:
    """One row for the run and for every group; rates are fractions, a value that does not exist is empty."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    writer.writerow(_row("overall", "overall", report["overall"]))
    for dimension, groups in report["by"].items():
        for group, block in groups.items():
            writer.writerow(_row(dimension, group, block))
    return buffer.getvalue()


def latex_text(report: Json, dimension: str = "event") -> str:
    """A ``tabular`` of one breakdown in percent and percentage points, with the whole run as its last row."""
    rows = [*report["by"][dimension].items(), ("All pairs", report["overall"])]
    lines = [
        f"% {_escaped(title_text(report))}",
        *(f"% {_escaped(note)}" for note in [report["substrate"]["note"]] if note),
        r"\begin{tabular}{lrrrrr}",
        r"\hline",
        rf"{dimension.capitalize()} & Pairs & Base & Dynamic & Change & Lost \\",
        r"\hline",
    ]
    for index, (group, block) in enumerate(rows):
        if index == len(rows) - 1:
            lines.append(r"\hline")
        change = block["paired_change"]
        lines.append(
            f"{_escaped(group)} & {_pairs(block)} & {_percent(block['base_success']['value'])} & "
            f"{_percent(block['dynamic_success']['value'])} & {_change(change)} & "
            rf"{_percent(block['conditional_regression']['value'])} \\"
        )
    return "\n".join([*lines, r"\hline", r"\end{tabular}"]) + "\n"


_MORE_RATES = ("conditional_regression", "trigger_coverage", "response_coverage")


def _row(dimension: str, group: str, block: Json) -> list[object]:
    rates = [
        block[name][part]
        for name in ("base_success", "dynamic_success", "paired_change")
        for part in ("value", "lower", "upper")
    ]
    return [
        dimension,
        group,
        block["planned"],
        block["played"],
        *rates,
        *block["outcomes"].values(),
        *(block[name]["value"] for name in _MORE_RATES),
        block["stale_actions"]["mean"],
        block["mcnemar"]["log10_p_value"],
    ]


def _pairs(block: Json) -> str:
    same = block["played"] == block["planned"]
    return str(block["played"]) if same else f"{block['played']} of {block['planned']}"


def _percent(value: float | None) -> str:
    return "--" if value is None else f"{100 * value:.1f}"


def _change(change: Json) -> str:
    if change["value"] is None:
        return "--"
    return f"${100 * change['value']:+.1f}$ [${100 * change['lower']:+.1f}$, ${100 * change['upper']:+.1f}$]"


def _escaped(text: str) -> str:
    return "".join(f"\\{letter}" if letter in "&%$#_{}" else letter for letter in text)
