"""The report as Markdown, for a repository or a pull request."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.caveats import caveat_text
from pytest_libero_max.report.summary import (
    change_text,
    count_text,
    incomplete_text,
    noise_text,
    p_text,
    rate_text,
    title_text,
)

TITLES = {
    "event": "Event",
    "family": "Family",
    "suite": "Suite",
    "source": "Source",
    "category": "Source category",
    "severity": "Severity",
    "variant": "Event and parameter variant",
}


def markdown(report: Json) -> str:
    """Render a report; ends with a newline."""
    provenance, pairs, overall = report["provenance"], report["pairs"], report["overall"]
    lines = [f"# {title_text(report)}", ""]
    if not pairs["complete"]:
        lines += [f"**{incomplete_text(pairs)}** All rates below are over the played pairs.", ""]
    if report["substrate"]["note"]:
        lines += [report["substrate"]["note"], ""]
    if report["caveats"]:
        lines += [*(f"- {caveat_text(caveat)}" for caveat in report["caveats"]), ""]
    outcomes = overall["outcomes"]
    lines += _table(
        ("Quantity", "Value"),
        [
            ("Pairs played of planned", f"{pairs['played']} of {pairs['planned']}"),
            ("Base success", rate_text(overall["base_success"])),
            ("Dynamic success", rate_text(overall["dynamic_success"])),
            ("Paired change", change_text(overall["paired_change"])),
            ("Preserved successes (1,1)", outcomes["preserved_success"]),
            ("Change-associated successes (0,1)", outcomes["change_associated_success"]),
            ("Regressions (1,0)", outcomes["regression"]),
            ("Persistent failures (0,0)", outcomes["persistent_failure"]),
            ("Base successes lost", rate_text(overall["conditional_regression"])),
            ("Exact McNemar", p_text(overall["mcnemar"])),
            ("Event fired", rate_text(overall["trigger_coverage"])),
            ("Query after the event", rate_text(overall["response_coverage"])),
            *(
                [("Noise floor: Base played twice", noise_text(report["noise_floor"]))]
                if report["noise_floor"]
                else []
            ),
        ],
    )
    for dimension, title in TITLES.items():
        groups = report["by"][dimension]
        lines += ["", f"## {title}", ""]
        lines += _table(
            (title, "Pairs", "Base", "Dynamic", "Paired change", "Base successes lost"),
            [
                (
                    name,
                    count_text({"count": block["played"], "of": block["planned"]}),
                    rate_text(block["base_success"]) + (" (floor)" if block["floor"] else ""),
                    rate_text(block["dynamic_success"]),
                    change_text(block["paired_change"]),
                    count_text(block["conditional_regression"]),
                )
                for name, block in groups.items()
            ],
        )
    lines += [
        "",
        "Intervals are 95%: Wilson for rates, exact paired bootstrap for changes. Groups hold different",
    ]
    lines += ["cases: differences between them are descriptions, not effects.", "", "## Provenance", ""]
    versions = [(name, version or "not installed") for name, version in provenance["versions"].items()]
    lines += _table(("Part", "Version"), [*versions, ("case set", provenance["case_set"]["digest"])])
    return "\n".join(lines) + "\n"


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    body = [" | ".join(str(cell).replace("|", "\\|") for cell in row) for row in (head, *rows)]
    return [f"| {body[0]} |", "|" + " --- |" * len(head), *(f"| {row} |" for row in body[1:])]
