from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from tests.scripts.interaction import ARMS, interaction


def record(*successes: int) -> Any:
    arms = {name: SimpleNamespace(success=bool(value)) for name, value in zip(ARMS, successes, strict=True)}
    return SimpleNamespace(arms=arms, source="plus", configuration="one")


def test_changes_that_cost_together_what_they_cost_alone_have_no_interaction() -> None:
    added = (record(1, 0, 1, 0), record(1, 1, 0, 0), record(1, 1, 1, 1))
    found = interaction(added)
    assert (found.gains, found.losses) == (0, 0)


def test_a_loss_of_both_alone_is_below_zero_and_one_that_cannot_be_lost_twice_is_above() -> None:
    found = interaction((record(1, 1, 1, 0), record(1, 1, 1, 0), record(1, 0, 0, 0), record(1, 1, 1, 1)))
    assert (found.gains, found.losses) == (1, 2)
    assert found.value == -0.25
