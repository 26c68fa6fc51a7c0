"""MuJoCo's line: Python 3.14 has a later one, in which boxes touch in another way, and numbers differ."""

from __future__ import annotations

from importlib.metadata import version

import pytest

from pytest_libero_max.worlds.versions import is_later_line

LINE = ".".join(version("mujoco").split(".")[:2])
"""For example ``3.3``, the line of the reference."""

of_the_reference = pytest.mark.skipif(is_later_line(LINE), reason="bits of MuJoCo 3.3")
