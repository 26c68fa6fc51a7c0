"""The comparison of a run with an earlier one, at its end."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PAIRS_NAME

if TYPE_CHECKING:
    from pytest_libero_max.report.comparison.comparison_document import Comparison

LAST = "last"

_FILES = (PAIRS_NAME, PACKED_PAIRS_NAME)


def comparison_at_the_end(asked: str, folder: Path, run: Run, start: Path) -> Comparison | str:
    """Return the comparison of an earlier run with this one, or why there is none: it is not decisive.

    Where this run has played a part of the cases of the earlier one, that part is compared.
    """
    from pytest_libero_max.report.comparison.compare import compare_runs, read_runs

    earlier = _last(folder, run) if asked == LAST else start / Path(asked).expanduser()
    if earlier is None:
        return f"No comparison: there is no other complete run of these cases beside {folder.name}."
    both = [path.relative_to(start) if path.is_relative_to(start) else path for path in (earlier, folder)]
    try:
        runs = read_runs(both)
        theirs, ours = ({pair.case_digest for pair in outcomes.run.planned} for outcomes in runs.values())
        return compare_runs(runs, restrict=ours <= theirs)
    except ReportError as error:
        return f"No comparison with {both[0]}: {error}"


def _last(folder: Path, run: Run) -> Path | None:
    """Return the folder of the complete run of the same cases that began last, of those beside a folder."""
    from pytest_libero_max.runs.status import Follower

    cases = {pair.case_digest for pair in run.planned}
    found = []
    for other in folder.parent.iterdir():
        if other.resolve() == folder.resolve() or not any((other / name).is_file() for name in _FILES):
            continue
        try:
            seen = Follower(other).look()
        except ReportError:  # it is damaged, or being written
            continue
        if seen.complete and {pair.case_digest for pair in seen.run.planned} == cases:
            found.append((str(seen.run.provenance.get("started", "")), other))
    return max(found)[1] if found else None
