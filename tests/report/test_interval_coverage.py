from __future__ import annotations

from pathlib import Path

import pytest

from tests.report.interval_coverage import (
    CHANGE_SIZES,
    CHANGES,
    DIFFERENCES,
    LATTICES,
    METHODS,
    QUANTITIES,
    RATES,
    SIZES,
    TASK_CELLS,
    change_rows,
    coverage_rows,
    lowest_change_rows,
    rate_rows,
    task_rows,
    worst_rows,
)

PUBLISHED = (Path(__file__).parents[2] / "reports" / "interval-coverage.md").read_text(encoding="utf-8")


def _table(title: str) -> list[list[str]]:
    """The cells of the table under a heading, without its first two lines."""
    section = PUBLISHED.split(f"## {title}\n")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("|")]
    return rows[2:]


@pytest.mark.parametrize("name", METHODS)
def test_the_published_coverage_is_what_the_code_finds(name: str) -> None:
    sizes = SIZES[:4]
    found = [row.strip("| ").split(" | ") for row in coverage_rows(name, sizes)]
    published = _table(METHODS[name][0])
    assert len(published) == len(CHANGES)
    assert [row[: 1 + len(sizes)] for row in published] == found


def test_the_published_coverage_of_rates_is_what_the_code_finds() -> None:
    published = ["| " + " | ".join(row) + " |" for row in _table("Exact interval of a success rate")]
    assert published == list(rate_rows())
    assert len(published) == len(RATES) + 1


def test_the_published_coverage_of_differences_of_changes_is_what_the_code_finds() -> None:
    published = _table("Difference of two paired changes")
    found = [_cells(row) for row in change_rows((4, 8), ())]
    assert [row[:3] for row in published[: len(DIFFERENCES)]] == found
    assert min(_percent(cell) for row in published[: len(DIFFERENCES)] for cell in row[1:]) >= 0.95
    lowest = [_cells(row) for row in lowest_change_rows((4,))]
    assert lowest[0] in published
    table = {row[0].strip(): row[1] for row in _table("Lowest coverage of what is printed")}
    alone = [cell for row in published[: len(DIFFERENCES)] for cell in row[1 : 1 + len(CHANGE_SIZES)]]
    assert table["difference of two paired changes"] == min(alone, key=_percent)


def test_the_published_worst_cases_are_what_the_code_finds() -> None:
    published = ["| " + " | ".join(row) + " |" for row in _table("Worst cases")]
    assert len(published) == len(LATTICES)
    assert published[:1] == list(worst_rows(LATTICES[:1]))


def test_the_lowest_coverages_are_those_of_the_other_tables() -> None:
    found = {row[0].strip(): row[1:] for row in _table("Lowest coverage of what is printed")}
    tasks = _table("Interval by task")
    for quantity in QUANTITIES.values():
        rows = [row for row in tasks if row[0] == quantity]
        assert len(rows) == sum(QUANTITIES[cell.quantity] == quantity for cell in TASK_CELLS)
        lowest, printed = found[f"{quantity}, by task"]
        assert lowest == min((row[4] for row in rows), key=_percent)
        assert printed == min((row[5] for row in rows if row[5].strip()), key=_percent)
        assert _percent(lowest) >= 93
    assert _percent(found["rate, share lost, coverage"][0]) >= 95


def test_the_published_coverage_by_task_is_what_the_code_finds() -> None:
    cells = [TASK_CELLS[place] for place in (3, -6)]
    published = ["| " + " | ".join(row) + " |" for row in _table("Interval by task")]
    assert [published[TASK_CELLS.index(cell)] for cell in cells] == list(task_rows(cells))


def _cells(row: str) -> list[str]:
    return row.strip("| ").split(" | ")


def _percent(cell: str) -> float:
    return float(cell.partition("%")[0])


def test_the_chosen_interval_is_nowhere_below_what_is_wanted() -> None:
    cells = [cell for row in _table(METHODS["exact"][0]) for cell in row[1:]]
    cells += [row[1] for row in _table("Worst cases")]
    assert len(cells) == len(CHANGES) * len(SIZES) + len(LATTICES)
    assert min(float(cell.partition("%")[0]) for cell in cells) >= 95
    assert any("!" in row[2] for row in _table("Worst cases"))
