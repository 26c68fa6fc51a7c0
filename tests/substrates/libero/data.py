"""Where the genuine package and its data are, for tests that need them."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from pytest_libero_max.substrates.libero.installation import INSTALL, REQUIREMENTS_INSTALL

DATA = Path(__file__).parents[4] / "shared" / "libero"
"""Assets, task descriptions and initial states of the four suites."""

HOW = (
    f"needs a genuine LIBERO: `{INSTALL}`, `{REQUIREMENTS_INSTALL}`, and its assets in "
    "../shared/libero/assets (the data set lerobot/libero-assets)"
)

SUITES = ("libero_spatial", "libero_object", "libero_goal", "libero_10")
TASKS = [(suite, index) for suite in SUITES for index in range(10)]

installed = importlib.util.find_spec("libero") is not None
needs_package = pytest.mark.skipif(not installed or not (DATA / "assets").is_dir(), reason=HOW)
needs_data = pytest.mark.skipif(
    not (DATA / "init_files").is_dir(), reason="needs LIBERO's initial states in ../shared/libero/init_files"
)
