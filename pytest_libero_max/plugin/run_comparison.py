"""The comparison of a run with an earlier one, at its end."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.errors import ReportError

if TYPE_CHECKING:
    from pytest_libero_max.report.comparison.comparison_document import Comparison


def comparison_at_the_end(asked: str, folder: Path, start: Path) -> Comparison | str:
    """Return the comparison of an earlier run with this one, or why there is none: it is not decisive.

    Where this run has played a part of the cases of the earlier one, that part is compared.
    """
    from pytest_libero_max.report.comparison.compare import compare_runs, read_runs

    earlier = start / Path(asked).expanduser()
    both = [path.relative_to(start) if path.is_relative_to(start) else path for path in (earlier, folder)]
    try:
        runs = read_runs(both)
        theirs, ours = ({pair.case_digest for pair in outcomes.run.planned} for outcomes in runs.values())
        return compare_runs(runs, restrict=ours <= theirs)
    except ReportError as error:
        return f"No comparison with {both[0]}: {error}"
