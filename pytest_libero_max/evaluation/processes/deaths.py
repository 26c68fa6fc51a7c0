"""Deaths of processes that play pairs: a pair is played again some times, and is then an error of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import counted, is_refusal
from pytest_libero_max.evaluation.processes.crash_log import Death
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.evaluation.stopping import Stop
from pytest_libero_max.pairing.record import CRASH_PHASE, POLICY_PHASE, PairError, PairRecord
from pytest_libero_max.report.report_document import InvalidPair
from pytest_libero_max.runs.media import CRASHES_NAME

DEATHS_IN_A_ROW = 4
"""Deaths in a row, for each process and each time that a pair may be played, after which a run stops."""

_NAMED = 5
"""Pairs that a line of the summary names."""


class Deaths:
    """Counts the deaths of the processes that play pairs."""

    def __init__(self, settings: Settings, processes: int, kind: str, stop: Stop) -> None:
        self.processes = processes
        self._settings = settings
        self._kind = kind
        self._stop = stop
        self._plays: Counter[str] = Counter()
        self._measured: set[str] = set()
        self._in_a_row = 0

    def died(self, death: Death) -> None:
        """Count a death. Stops the run where nothing but deaths happens any more."""
        self._in_a_row += 1
        if self._in_a_row >= DEATHS_IN_A_ROW * self.processes * (self._settings.retries + 1):
            self._stop.stop(
                f"{self._in_a_row} {self._kind} died one after another, and none of them measured a pair; "
                f"the last one: {death.error}"
            )

    def stored(self, pair: PairRecord | PairError) -> None:
        """Begin to count deaths in a row again after a measured pair."""
        if isinstance(pair, PairRecord):
            self._measured.add(pair.item_id)
            self._in_a_row = 0

    def lose(self, case: Case, death: Death, play_again: Callable[[], bool]) -> PairError | str:
        """Return the error of a pair whose process died; words where it is played again, or need not be.

        Stops the run where every other pair would end like this one. A pair of a run that has been stopped is
        not played again: it stays missing.

        Args:
            play_again: Gives the pair to another process; returns whether that is possible.
        """
        if case.item_id in self._measured:  # it died between this pair and the next
            return f"{death.error} The pair was measured before."
        self._plays[case.item_id] += 1
        plays = self._plays[case.item_id]
        keep_text(self._settings.output, case.item_id, plays, death.text)
        if plays <= self._settings.retries and self._stop.stopped is not None:
            return f"{death.error} The run was stopped."
        if plays <= self._settings.retries and play_again():
            return f"{death.error} It is played again."
        error = pair_error(case, death, plays)
        if error.phase == POLICY_PHASE:
            self._stop.stop("the policy cannot be played: it ends each process that loads it")
        return error


def pair_error(case: Case, death: Death, plays: int) -> PairError:
    """Error of a pair that is not played again."""
    more = f" Played {counted(plays, 'time')}."
    if death.text:
        more += f" All that was said: {CRASHES_NAME}/{_name(case.item_id, plays)}."
    phase = POLICY_PHASE if death.phase == POLICY_PHASE else CRASH_PHASE
    return PairError.of(case, death.error, phase, more)


def set_aside_lines(invalid: Sequence[InvalidPair]) -> list[str]:
    """Sentence that names the pairs whose processes died each time; none where there is no such pair."""
    names = [pair.item_id for pair in invalid if pair.phase == CRASH_PHASE]
    if not names:
        return []
    return [
        f"Set aside, because each process that played it died: {_few(names)}. "
        f"report.json has all of them; {CRASHES_NAME} has what they said."
    ]


def refused_lines(invalid: Sequence[InvalidPair]) -> list[str]:
    """Sentence that names the pairs that were refused for what the policy did; none where there is none."""
    refused = [pair for pair in invalid if is_refusal(pair.kind)]
    if not refused:
        return []
    return [
        "Refused for what the policy did, and not played again by a rerun or --libero-max-resume: "
        f"{_few([pair.item_id for pair in refused])}. The first: {refused[0].message} Then begin a new run."
    ]


def _few(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def keep_text(output: Path, item_id: str, number: int, text: str) -> None:
    """Keep the last output of a dead process, as far as the disk has room."""
    if not text:
        return
    with suppress(OSError):
        folder = output / CRASHES_NAME
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _name(item_id, number)).write_text(text, encoding="utf-8")


def _name(item_id: str, number: int) -> str:
    return f"{item_id}.{number}.txt"
