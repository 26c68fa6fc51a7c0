from __future__ import annotations

from collections.abc import Iterator

import pytest

from pytest_libero_max.substrates.opening import open_substrate
from pytest_libero_max.worlds.contract import Substrate


@pytest.fixture(scope="module")
def substrate() -> Iterator[Substrate]:
    opened = open_substrate("embedded")
    yield opened
    opened.close()
