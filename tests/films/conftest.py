from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from .short_run import Played, leave_out_shadows, play, shorten_episodes


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_out_shadows(monkeypatch)
    shorten_episodes(monkeypatch)


@pytest.fixture(scope="session")
def played_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Played, Path]]:
    """A pair that no test changes, and its manifest."""
    folder = tmp_path_factory.mktemp("played")
    with pytest.MonkeyPatch.context() as patch:
        leave_out_shadows(patch)
        shorten_episodes(patch)
        played = play(folder)
    yield played, folder / "tiny.json"
    played.world.close()


@pytest.fixture
def played(played_once: tuple[Played, Path], tmp_path: Path) -> Played:
    """The pair, with its manifest in the folder of the test."""
    shutil.copy(played_once[1], tmp_path)
    return played_once[0]
