"""certain: stop once no remaining outcome can change the verdict of any gate."""

from __future__ import annotations

from collections.abc import Iterable

from pytest_libero_max.errors import OptionError
from pytest_libero_max.report.gate_bounds import BOUNDED, Ending, GateRule, Watch, all_endings
from pytest_libero_max.report.gates import Gate
from pytest_libero_max.report.stopping_rule import Declared


class Certain(GateRule):
    """Stops where all ways in which the other pairs can end leave the verdicts as they are."""

    def check(self, declared: Declared) -> str | None:
        super().check(declared)
        if not declared.gates:
            raise OptionError("there is no gate to be certain of. Add --libero-max-gate=CONDITION.")
        unbounded = [gate.text for gate in declared.gates if not _is_bounded(gate)]
        if not unbounded:
            return None
        return f"stop: certain never stops this run, for no bounds are known of {'; '.join(unbounded)}"

    def watch(self, gate: Gate, pairs: int) -> Watch | None:
        seen = Ending()

        def endings(pair: Ending) -> Iterable[Ending]:
            nonlocal seen
            seen += pair
            return all_endings(seen, pairs)

        return endings if _is_bounded(gate) else None


def _is_bounded(gate: Gate) -> bool:
    return gate.name in BOUNDED and gate.run is None
