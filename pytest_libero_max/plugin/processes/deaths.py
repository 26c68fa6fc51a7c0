"""What becomes of a pair whose process died, in the words of its record."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import PairError
from pytest_libero_max.plugin.processes.crash_log import Death
from pytest_libero_max.plugin.stash_keys import POLICY_PHASE
from pytest_libero_max.runs.media import CRASHES_NAME

CRASH_PHASE = "crash"
_NAMED = 5


def pair_error(case: Case, death: Death, plays: int) -> PairError:
    """The error of a pair that is not played again.

    Args:
        case: The pair.
        death: How its last process died.
        plays: How many processes it had.
    """
    again = f"Played {plays} times" if plays > 1 else "Played once"
    message = f"{death.error} {again}."
    if death.text:
        message += f" All that was said: {CRASHES_NAME}/{_name(case.item_id, plays)}."
    phase = POLICY_PHASE if death.phase == POLICY_PHASE else CRASH_PHASE
    return PairError(case.case_id, case.item_id, case.digest, type(death.error).__name__, message, phase)


def set_aside_lines(invalid: Sequence[Json]) -> list[str]:
    """A sentence that names the pairs whose processes died each time; none where there is no such pair.

    Args:
        invalid: ``invalid_pairs`` of a report.
    """
    names = [pair["item_id"] for pair in invalid if pair["phase"] == CRASH_PHASE]
    if not names:
        return []
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return [
        f"Set aside, because each process that played it died: {', '.join(names[:_NAMED])}{more}. "
        f"report.json has all of them; {CRASHES_NAME} has what they said."
    ]


def keep_text(output: Path, item_id: str, number: int, text: str) -> None:
    """Keep what a process said before it died, where there is room."""
    if not text:
        return
    with suppress(OSError):
        folder = output / CRASHES_NAME
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _name(item_id, number)).write_text(text, encoding="utf-8")


def _name(item_id: str, number: int) -> str:
    return f"{item_id}.{number}.txt"
