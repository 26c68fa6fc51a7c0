"""The first pair of a process, played again after others: it is another one if the policy remembers them.

Base alone is played again. That is half of the time, and the other arms share its beginning and its policy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import AdapterError
from pytest_libero_max.pairing.record import PairRecord

AGAIN_AFTER = 8
"""Pairs that a process has played when it plays its first one again, once."""


@dataclass
class _Played:
    case: Case
    record: PairRecord
    pairs: int = 0


_FIRST = pytest.StashKey[_Played]()


def require_first_pair_again(
    config: pytest.Config, case: Case, record: PairRecord, play: Callable[[Case], PairRecord]
) -> None:
    """Take in a pair that was played; after :data:`AGAIN_AFTER` of them play the first one again.

    Args:
        config: Of the process.
        case: The case that was played.
        record: Its record.
        play: Plays a case in this process, at least one of its arms.

    Raises:
        AdapterError: The first pair is another one than before.
    """
    first = config.stash.setdefault(_FIRST, _Played(case, record))
    first.pairs += 1
    if first.pairs != AGAIN_AFTER:
        return
    again = play(first.case).arms
    different = [name for name, arm in again.items() if first.record.arms[name].proof != arm.proof]
    if different:
        raise AdapterError(
            f"the policy remembers something from pair to pair: {first.case.item_id} was played again after "
            f"{AGAIN_AFTER} pairs, and {' and '.join(different)} came out otherwise, so that results depend "
            "on what was played before. Let reset() empty queues, histories, counters and generators; "
            "libero-max check finds most of it. Declare PolicySpec(repeatable=False) only for a server whose "
            "arithmetic varies."
        )
