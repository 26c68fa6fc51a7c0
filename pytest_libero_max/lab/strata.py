"""strata:LEVEL: stop once a change is shown anywhere among events and suites, looking at every pair."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from pytest_libero_max.errors import OptionError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.gates import Gate
from pytest_libero_max.report.stopping_rule import Declared, StoppingRule, level_of
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.sequential import log_evidence_of_change


class Strata(StoppingRule):
    """Stops a run once it is shown that losses and gains are not equally likely in some event of some suite.

    Losses in one stratum and gains in another do not cancel out here, as they do for ``anytime``. Where no
    stratum has a change, a run is stopped with at most the probability LEVEL, however often the rule looks.
    It knows nothing of gates.

    Args:
        arguments: The level, above 0 and up to 0.5; empty for 0.05.
    """

    def __init__(self, arguments: str) -> None:
        self.level = level_of("strata", arguments)

    def check(self, declared: Declared) -> str | None:
        if declared.order.seed is None:
            raise OptionError(
                f"in the order {declared.order} the first pairs are the first cases of a list. Add "
                "--libero-max-order=blocks:SEED or shuffled:SEED with a seed of your choice."
            )
        if declared.shards > 1:
            raise OptionError(
                "each shard would decide for itself. Play the run on several machines with --libero-max-ray, "
                "or leave the rule out."
            )
        name, _, level = ((declared.begun or {}).get("stopping_rule") or "").partition(":")
        if name == "strata" and Strata(level).level != self.level:
            raise OptionError(
                f"level={self.level:g}, but the run that is resumed was begun with strata:{level}. Resume "
                "with the same, or choose another output folder."
            )
        return None

    def begin(self, planned: Sequence[PlannedPair], gates: Sequence[Gate]) -> None:
        super().begin(planned, gates)
        self._lost: Counter[tuple[str, str]] = Counter()
        self._gained: Counter[tuple[str, str]] = Counter()

    def after(self, pair: PairRecord | PairError) -> str | None:
        if isinstance(pair, PairError) or pair.base_success == pair.dynamic_success:
            return None
        (self._lost if pair.base_success else self._gained)[pair.event, pair.suite] += 1
        strata = sorted({*self._lost, *self._gained})
        evidence = log_evidence([(self._lost[stratum], self._gained[stratum]) for stratum in strata])
        if evidence < -math.log(self.level):
            return None
        most = max(strata, key=lambda each: log_evidence_of_change(self._lost[each], self._gained[each]))
        return (
            f"losses and gains are not equally likely in every event and suite, p = "
            f"{math.exp(-evidence):.2g} at any time; farthest from it is {most[0]} of {most[1]}: "
            f"{self._lost[most]} lost, {self._gained[most]} gained"
        )


def log_evidence(counts: Iterable[tuple[int, int]]) -> float:
    """Return the natural logarithm of the evidence that in some stratum losses and gains differ in chance.

    Half of the capital is bet on one change that all strata share, :func:`log_evidence_of_change` of all
    discordant pairs; the other half on a chance of its own in each stratum: there the evidence of the strata
    is multiplied, as each pair is a fair bet in its own. Under the null of every stratum it ever reaches
    1 / level with at most the probability ``level``. Reference: R. Turner and P. Gruenwald (2023), Exact
    anytime-valid confidence intervals for contingency tables and beyond, Statist. Probab. Lett. 198:109835
    (arXiv 2302.11401), whose strata are those of 2 x 2 tables; here they are of discordant pairs.

    Args:
        counts: Lost and gained pairs of each stratum.
    """
    strata = [*counts]
    losses, gains = (sum(stratum[kind] for stratum in strata) for kind in (0, 1))
    pooled = log_evidence_of_change(losses, gains)
    apart = sum(log_evidence_of_change(*stratum) for stratum in strata)
    return float(np.logaddexp(pooled, apart)) - math.log(2)
