"""Work left of a run, expected from the pairs that it has measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.runs.costs import CostModel, Kind, seconds_of
from pytest_libero_max.runs.plan import PlannedPair


class WorkLeft:
    """The pairs of a run that are not done, and their expected cost."""

    def __init__(self, planned: Sequence[PlannedPair]) -> None:
        self._model = CostModel()
        self._kinds = {pair.item_id: pair.kind for pair in planned}
        self._left = Counter(self._kinds.values())
        self._suites: frozenset[str] | None = None
        self._took_s: list[float] = []
        self._left_s: float | None = None  # what all that is left takes, as long as nothing new is known

    def remove(self, item_id: str) -> None:
        """Note that a pair is done: measured, or an error."""
        self._left_s = None
        if item_id in self._kinds:
            self._left[self._kinds[item_id]] -= 1

    def learn(self, record: PairRecord) -> None:
        """Learn from the cost of a measured pair."""
        self._left_s = None
        kind = self._kinds.get(record.item_id)
        if kind is not None:
            self._model.add(kind, record)
        self._took_s.append(seconds_of(record))
        if self._suites is None and record.policy.get("suites") is not None:
            self._suites = frozenset(record.policy["suites"])

    def seconds_left(self, before: int, seconds: float, playing: Mapping[str, float]) -> float | None:
        """Return the expected duration of the pairs that are left.

        As many pairs are played at once from now on as until now, on average. At the end the longest pair
        decides.

        Args:
            before: Number of measured pairs, the first ones, that an earlier session played.
            seconds: Since this session began.
            playing: Seconds that each running pair has been played, by item id.

        Returns:
            Seconds; None where nothing is known of costs.
        """
        at_once = (sum(self._took_s[before:]) + sum(playing.values())) / seconds if seconds > 0 else 0.0
        if not self._model.pairs or at_once <= 0:
            return None
        if self._left_s is None:
            self._left_s = sum(count * self._expected_s(kind) for kind, count in self._left.items() if count)
        left = self._left_s
        rests = [0.0]
        for item_id, played in playing.items():
            if item_id in self._kinds:
                expected = self._expected_s(self._kinds[item_id])
                left -= min(played, expected)
                rests.append(expected - played)
        return max(left / at_once, *rests)

    def _expected_s(self, kind: Kind) -> float:
        if self._suites is not None and kind.suite not in self._suites:
            return 0.0
        return self._model.expected(kind).seconds
