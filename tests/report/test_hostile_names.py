"""Names with markup and escape sequences, in a run that another wrote: no writer passes them on."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.cases import parse_case
from pytest_libero_max.cli import main
from pytest_libero_max.errors import AdapterError, ManifestError, ReportError
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import common_cases, compare_runs
from pytest_libero_max.report.comparison.compare_files import comparison_html, comparison_markdown
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_tables import latex_text
from pytest_libero_max.report.writers.report_files import all_figures, run_page
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import StoredRun
from tests.report.made_up import PROVENANCE, error_of, page_cases, plan, record_of, run_of, write_run

HTML = "'\"><img src=x onerror=alert(1)></script><script>alert(2)</script>"
LINK = "![x](//evil.example/x.png) [x](javascript:alert(3))"
TERMINAL = "\x1b[2J\x1b]0;gone\x07\x9b31m\u202eneve\r\n::error::forged\n```\n# forged"
LATEX = r"\input{/etc/passwd}%^~"
MARKUP = HTML + LINK + LATEX
HOSTILE = MARKUP + TERMINAL
PRINTABLE = MARKUP.replace("/", "")
"""What a reader lets pass as the name of a pair."""


def _run(name: str) -> StoredRun:
    """A run with hostile names.

    Args:
        name: Those of the fields that readers check.
    """
    planned = []
    for number, pair in enumerate(plan(sources=("plus",))):
        item = f"{name}{number}"
        hostile = structs.replace(
            pair, case_id=item, item_id=item, source_category=name, severity=name, task=name
        )
        planned.append(hostile if number % 2 else structs.replace(hostile, event=name, family=name))
    checked = ("case_id", "item_id", "source_category", "severity", "event", "family")
    records = []
    for number, (pair, hostile) in enumerate(zip(plan(sources=("plus",))[2:], planned[2:], strict=True)):
        record = record_of(pair, True, number % 3 > 0, instruction=HOSTILE)
        policy = {**record.policy, "name": MARKUP, "suites": ["libero_spatial"]}
        names = {field: getattr(hostile, field) for field in checked}
        records.append(structs.replace(record, policy=policy, **names))
    error = structs.replace(error_of(plan()[0]), case_id=planned[0].case_id, item_id=planned[0].item_id)
    errors = [structs.replace(error, kind=HOSTILE, message=HOSTILE)]
    provenance = {
        **PROVENANCE,
        "versions": {**PROVENANCE["versions"], HOSTILE: HOSTILE},
        "case_set": {"name": HOSTILE, "digest": "0" * 64, "released_as": HOSTILE},
        "policy": {**PROVENANCE["policy"], "reference": HOSTILE},
        "command": ["pytest", HOSTILE],
    }
    run = run_of(planned, records, provenance, errors)
    return replace(run, stopped=Stopped(reason=HOSTILE, of=len(planned)))


RUN = _run(HOSTILE)
REPORT = structs.replace(
    build_report(RUN.records, RUN.errors, RUN.run.planned, RUN.run.provenance, RUN.stopped),
    sections={HOSTILE: {HOSTILE: HOSTILE}},
)
OTHER = replace(RUN, stopped=None)
RUNS = {f"a{HOSTILE}": RUN, f"b{HOSTILE}": OTHER}


class _Tags(HTMLParser):
    def __init__(self, page: str) -> None:
        super().__init__()
        self.scripts = 0
        self.unexpected: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.scripts += tag == "script"
        for name, value in attrs:
            if name.startswith("on") or (name in ("src", "href") and "alert" in (value or "")):
                self.unexpected.append(f"{tag} {name}")


@pytest.mark.parametrize("kind", ["run", "comparison"])
def test_a_page_shows_names_as_text(kind: str) -> None:
    common = common_cases(RUNS, restrict=True)
    page = (
        run_page(REPORT, RUN, Path("nowhere"))
        if kind == "run"
        else comparison_html(compare_runs(RUNS, restrict=True), common)
    )
    tags = _Tags(page)
    assert (tags.scripts, tags.unexpected) == (3, [])  # two hold data
    assert "<img src=x" not in page
    assert HOSTILE in " ".join(page_cases(page)["items"])


@pytest.mark.parametrize("text", [markdown(REPORT), comparison_markdown(compare_runs(RUNS, restrict=True))])
def test_markdown_holds_no_markup_of_names(text: str) -> None:
    outside = re.sub(r"^````text\n.*?^````\n", "", text, flags=re.S | re.M)
    outside = re.sub(r"`[^`\n]*`", "", outside)  # code, which is shown as it is
    assert "<" not in outside
    assert "](" not in re.sub(r"!\[[^]]*\]\([a-z-]+\.svg\)", "", outside)
    assert "\n# forged" not in outside
    assert [line for line in text.splitlines() if not line.isprintable()] == []


def test_figures_and_latex_show_names_as_text() -> None:
    for svg in all_figures(REPORT).values():
        ElementTree.fromstring(svg)
    table = latex_text(REPORT)
    assert r"\input" not in table
    assert [line for line in table.splitlines() if not line.isprintable()] == []
    assert all(line.startswith("%") for line in table.splitlines()[:2])


@pytest.mark.parametrize(
    "command",
    [
        ("report",),
        ("compare", "--restrict"),
        ("gate", "--gate=delta >= -100%"),
        ("plan", "pairs", "--run"),
        ("runs", "--follow"),
    ],
)
def test_a_terminal_is_not_steered_by_names(
    command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = [tmp_path / "one", tmp_path / "other"][: 2 if command[0] == "compare" else 1]
    for folder in folders:
        write_run(folder, _run(PRINTABLE))
    main([*command, *map(str, folders)])
    said = capsys.readouterr()
    assert said.out + said.err
    assert [line for line in (said.out + said.err).split("\n") if not line.isprintable()] == []
    assert "\n::error" not in said.out + said.err


@pytest.mark.parametrize(
    "name", ["\x1b[2J", "a\nb", "a\n", "\u202eb", "\x9f", "a/b", "..\\b"], ids=lambda name: ascii(name)
)
def test_a_run_with_names_that_are_no_names_is_refused(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    planned = [structs.replace(pair, item_id=f"{name}{pair.item_id}") for pair in plan()]
    write_run(tmp_path / "run", run_of(planned, []))
    assert main(["report", str(tmp_path / "run")]) == 1
    said = capsys.readouterr().err
    assert "run: planned[" in said
    assert "printable text" in said
    assert all(line.isprintable() for line in said.splitlines())


def test_names_of_records_policies_and_cases_are_checked() -> None:
    stored = record_of(plan()[0], True, True).to_dict()
    for values in ({"event": TERMINAL}, {"policy": {**stored["policy"], "name": TERMINAL}}):
        with pytest.raises(ReportError, match="printable text"):
            PairRecord.from_dict({**stored, **values})
    with pytest.raises(AdapterError, match=r"of a policy, .* printable"):
        PolicySpec(TERMINAL)
    case = {**make_case("camera_shift", "libero_goal", 0).record, "case_id": TERMINAL}
    with pytest.raises(ManifestError, match="printable text"):
        parse_case(case)
