from __future__ import annotations

from collections.abc import Iterator

import pytest

from pytest_libero_max.substrates.libero import substrate as libero_substrate
from pytest_libero_max.substrates.libero.installation import Installation, find_installation
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from tests.substrates.libero.data import DATA, HOW, installed


@pytest.fixture(autouse=True)
def many_worlds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests compare several worlds of one substrate; a run plays one after the other."""
    monkeypatch.setattr(libero_substrate, "KEPT_WORLDS", 8)


@pytest.fixture(scope="session")
def installation() -> Installation:
    if not installed or not (DATA / "assets").is_dir():
        pytest.skip(HOW)
    return find_installation(assets=DATA / "assets")


@pytest.fixture
def substrate(installation: Installation) -> Iterator[LiberoSubstrate]:
    substrate = LiberoSubstrate([installation])
    yield substrate
    substrate.close()
