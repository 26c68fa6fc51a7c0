from __future__ import annotations

from collections.abc import Iterator

import pytest

from pytest_libero_max.substrates.contract import Substrate
from pytest_libero_max.substrates.registry import open_substrate


@pytest.fixture(scope="module")
def substrate() -> Iterator[Substrate]:
    opened = open_substrate("embedded")
    yield opened
    opened.close()
