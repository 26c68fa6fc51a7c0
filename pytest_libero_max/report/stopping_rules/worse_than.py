"""worse_than:RUN or worse_than:LEVEL,RUN: stop once it is shown that this run loses more than another one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.gates import Gate
from pytest_libero_max.report.stopping_rule import Declared, StoppingRule
from pytest_libero_max.runs.comparability import COMPARISON, HERE, THERE, Side, differences_between, listed
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.store import StoredRun, read_pairs
from pytest_libero_max.stats.sequential import log_evidence_of_change

LEVEL = 0.05


class WorseThan(StoppingRule):
    """Stops a run in a random order once its Dynamic is shown to be worse than that of an earlier run.

    A case is lost where the earlier run completes Dynamic and this one does not, and gained the other way
    round. The run stops at the first lost case at which losses and gains are not equally likely, by the
    sequential McNemar test. If no case is gained, that takes 8 losses at level 0.05. The rule decides nothing
    where the runs differ in more than their policies.

    Args:
        arguments: Folder of the earlier run, with the level before it, above 0 and up to 0.5, where it is not
            0.05.
    """

    def __init__(self, arguments: str) -> None:
        first, comma, rest = arguments.partition(",")
        self._folder = rest if comma else arguments
        self._run: Run | None = None
        try:
            self._level = float(first) if comma else LEVEL
        except ValueError:
            self._level = math.nan
        if not (0 < self._level <= 0.5 and self._folder):
            raise ValueError(
                "expected worse_than:RUN or worse_than:LEVEL,RUN with a level above 0 and up to 0.5 and the "
                "folder of a run, for example worse_than:0.01,reports/v1"
            )

    def check(self, declared: Declared) -> str | None:
        if declared.order.seed is None:
            raise OptionError(
                f"in the order {declared.order} losses of one kind come one behind the other. Add "
                "--libero-max-order=shuffled:SEED with a seed of your choice."
            )
        try:
            read_pairs(Path(self._folder))
        except ReportError as error:
            raise OptionError(f"the other run, {self._folder}, cannot be read: {error}") from error
        return None

    def check_run(self, run: Run) -> None:
        self._run = run
        self._require_comparable(None)

    def _require_comparable(self, record: PairRecord | None) -> None:
        """Refuse another run that differs in more than its policy."""
        assert self._run is not None
        other = RunOutcomes.of(read_pairs(Path(self._folder)))
        there, here = Side(other.run), Side(self._run)
        if record is not None:
            there = other.side
            here = RunOutcomes.of(StoredRun(self._run, (record,), (), torn=False)).side
        found = differences_between({THERE: there, HERE: here}, COMPARISON)
        if found:
            raise OptionError(
                f"the other run, {self._folder}, also differs in {listed(found)}, so that a loss is not "
                "of the policy alone. Play both alike, or leave the rule out."
            )

    def begin(self, planned: Sequence[PlannedPair], gates: Sequence[Gate]) -> None:
        super().begin(planned, gates)
        other = read_pairs(Path(self._folder)).records
        self._before = {record.case_id: record.dynamic_success for record in other}
        self._losses = self._gains = 0
        self._comparable: bool | None = None  # known from the first record on

    def after(self, pair: PairRecord | PairError) -> str | None:
        if self._comparable is None and isinstance(pair, PairRecord):
            self._comparable = self._run is None or self._asks_alike(pair)
        if not self._comparable:
            return None
        before = self._before.get(pair.case_id)
        if isinstance(pair, PairError) or before is None or before == pair.dynamic_success:
            return None
        if pair.dynamic_success:
            self._gains += 1
            return None
        self._losses += 1
        evidence = log_evidence_of_change(self._losses, self._gains)
        if self._losses <= self._gains or evidence < -math.log(self._level):
            return None
        return (
            f"worse than {self._folder}: {self._losses} lost, {self._gains} gained, "
            f"p = {math.exp(-evidence):.2g} at any time"
        )

    def _asks_alike(self, record: PairRecord) -> bool:
        """Return True if a record was played as those of the other run, but for the policy."""
        try:
            self._require_comparable(record)
        except OptionError:
            return False
        return True
