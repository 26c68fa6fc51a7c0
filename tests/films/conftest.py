from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .short_run import Played, leave_out_shadows, play, shorten_episodes


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    leave_out_shadows(monkeypatch)
    shorten_episodes(monkeypatch)


@pytest.fixture
def played(short: None, tmp_path: Path) -> Iterator[Played]:
    played = play(tmp_path)
    yield played
    played.world.close()
