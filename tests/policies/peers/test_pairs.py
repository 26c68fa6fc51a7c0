"""Pairs of a policy behind a published server, in another process, are those of the policy in process."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.pairing.actors import make_case
from tests.policies.peers.conftest import peer, require
from tests.policies.peers.reach import Reach


@pytest.fixture
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


@pytest.fixture
def small(tmp_path: Path) -> dict[str, str]:
    """The profiles with small images, which take less time."""
    found = {}
    for name in ("vla_eval_pi05", "pi05_libero"):
        path = tmp_path / f"small_{name}.toml"
        path.write_text(f'extends = "{name}"\n[policy]\nimage_size = 8\n')
        found[name] = str(path)
    return found


def arms(record: PairRecord) -> Any:
    assert record.triggered
    return record.identity()["arms"]


@pytest.mark.parametrize(
    ("module", "script", "scheme", "profile", "dtype"),
    [
        ("vla_eval", ("vla_eval_server.py", "reach", "8"), "vla-eval", "vla_eval_pi05", np.float32),
        ("openpi.serving", ("openpi_server.py",), "openpi", "pi05_libero", np.float64),
    ],
)
def test_a_pair_of_a_published_server_is_that_of_its_policy_in_process(
    module: str,
    script: tuple[str, ...],
    scheme: str,
    profile: str,
    dtype: type[np.floating[Any]],
    world: TinyWorld,
    small: dict[str, str],
) -> None:
    require(module)
    case = make_case(distance_m=0.3)
    with peer(*script) as port:
        served = load_served(f"{scheme}://127.0.0.1:{port}", small[profile])
        record = measure_pair(case, world, served).record
        served.client.close()
    own = measure_pair(case, world, Reach(served.spec, dtype)).record
    assert arms(record) == arms(own)
