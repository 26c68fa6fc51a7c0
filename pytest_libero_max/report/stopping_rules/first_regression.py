"""first_regression: stop at the first pair in which Base succeeds and Dynamic does not."""

from __future__ import annotations

from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.stopping_rule import StoppingRule


class FirstRegression(StoppingRule):
    """Stops a run at the first case that an event breaks, for a policy that is to lose none."""

    def after(self, pair: PairRecord | PairError) -> str | None:
        if isinstance(pair, PairError) or pair.outcome != "regression":
            return None
        return f"{pair.item_id} is a regression"
