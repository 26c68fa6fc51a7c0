"""The page of published implementations follows from their examinations."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.conformance.results import RuleResult, conformance, conformance_json
from pytest_libero_max.conformance.rules import Finding, Level, Outcome, Rule, broken, kept, unexamined
from pytest_libero_max.makers.field import FIELD_NAME, field_page, read_about, read_field

ROOT = Path(__file__).parents[2]
PUBLISHED = ROOT / "reports" / "field"

ABOUT = """
title = "Published environments"
lead = ["What was found."]
method = ["How."]
[implementations.first]
title = "First"
[implementations.second]
title = "Second"
notes = ["It does not install."]
"""


def _rule(subject: object) -> Iterator[Finding]:
    """Be one."""
    yield kept("one")


def _examination(state: Finding, level: Level) -> str:
    outcome = Outcome(Rule("env/a/b", level, _rule), (state,))
    return conformance_json(conformance("env:x:y", {"env/a/b": RuleResult.of(outcome)}, ["env/a/b"]))


@pytest.mark.parametrize(
    ("finding", "level", "cell"),
    [
        (broken("two", "one", "Divide."), "must", "**broken**"),
        (broken("two", "one", "Divide."), "should", "differs"),
        (kept("one"), "must", ""),
        (unexamined("no clock"), "must", "-"),
    ],
)
def test_an_examination_is_a_column_and_a_section(
    finding: Finding, level: Level, cell: str, tmp_path: Path
) -> None:
    (tmp_path / "about.toml").write_text(ABOUT)
    (tmp_path / "one.json").write_text(_examination(finding, level))
    assert main(["dev", "field", str(tmp_path), f"first={tmp_path / 'one.json'}"]) == 0
    page = (tmp_path / "README.md").read_text()
    row = next(line for line in page.splitlines() if line.startswith("| `a/b` | " + level))
    assert row.split("|")[3].strip() == cell
    assert "- Second: " in page
    assert (tmp_path / FIELD_NAME).exists()


def test_an_implementation_that_nothing_is_known_of_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "about.toml").write_text(ABOUT)
    (tmp_path / "one.json").write_text(_examination(kept("one"), "must"))
    assert main(["dev", "field", str(tmp_path), f"third={tmp_path / 'one.json'}"]) != 0
    assert "[implementations.NAME]" in capsys.readouterr().err


def test_the_published_page_follows_from_the_file_beside_it() -> None:
    field = read_field((PUBLISHED / FIELD_NAME).read_text())
    assert field_page(field, read_about(PUBLISHED / "about.toml")) == (PUBLISHED / "README.md").read_text()
