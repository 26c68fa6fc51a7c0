"""The one test of the benchmark: its items are the pairs."""

from __future__ import annotations

import pytest

from pytest_libero_max.errors import counted
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.events.schedules import DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.happenings import happenings, happenings_text


def test_pair(libero_max_pair: PairRecord, libero_max_settings: Settings) -> None:
    """Passes when the pair was validly measured, whatever the policy did.

    The pair is played by its fixture, so that a broken simulator, adapter or protocol is an *error* of the
    item and only ``--libero-max-strict=regressions`` can make it *fail*.
    """
    pair = libero_max_pair
    if libero_max_settings.strict == "regressions" and pair.outcome == "regression":
        pytest.fail(
            f"{pair.item_id}: Base succeeds after {counted(pair.base_steps, 'step')}, Dynamic does not "
            f"within {pair.max_steps}. {happenings_text(happenings(pair, pair.arm(DYNAMIC)))}.",
            pytrace=False,
        )
