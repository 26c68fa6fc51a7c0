from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore
from tests.report.made_up import PROVENANCE, plan, records_of


@pytest.fixture
def stored(tmp_path: Path) -> Callable[..., str]:
    """Writes a run of made-up pairs and returns its folder."""

    def write(name: str, seed: int) -> str:
        pairs = plan(per_cell=2)
        store = PairStore(tmp_path / name, Run(tuple(pairs), PROVENANCE))
        for record in records_of(pairs, seed=seed):
            store.append(record)
        store.close()
        return str(tmp_path / name)

    return write
