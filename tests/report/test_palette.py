from __future__ import annotations

import colorsys
import re
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.report.palette import ARMS, DARK, LIGHT, arm_colors, css

SEEN = {
    "all colours": np.eye(3),
    "no red": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no green": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "no blue": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}  # fmt: skip
"""Linear RGB as seen (G. M. Machado et al. (2009), IEEE TVCG 15:1291-1298, severity 1)."""

BESIDE_EACH_OTHER = (("arm0", "arm1", "event"), ("loss", "gain"), ("loss", "arm1"), ("loss", "event"))

_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
_CLEARLY_DIFFERENT = 20.0
"""CIE 1976 difference; about 2 is just seen."""


def _rgb(color: str) -> NDArray[np.float64]:
    return np.array([int(color[at : at + 2], 16) / 255 for at in (1, 3, 5)])


def _lab(color: str, seen: NDArray[np.float64]) -> NDArray[np.float64]:
    rgb = _rgb(color)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    x, y, z = np.cbrt(_XYZ @ np.clip(seen @ linear, 0, 1) / (0.9505, 1.0, 1.089))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("seen", SEEN)
@pytest.mark.parametrize("colors", [LIGHT, DARK], ids=["light", "dark"])
def test_colours_beside_each_other_differ_for_everybody(colors: dict[str, str], seen: str) -> None:
    for names in BESIDE_EACH_OTHER:
        for one, other in combinations(names, 2):
            apart = np.linalg.norm(_lab(colors[one], SEEN[seen]) - _lab(colors[other], SEEN[seen]))
            assert apart >= _CLEARLY_DIFFERENT, (one, other, seen, apart)


@pytest.mark.parametrize("colors", [LIGHT, DARK], ids=["light", "dark"])
def test_nothing_is_red_but_what_is_worse(colors: dict[str, str]) -> None:
    for name, color in colors.items():
        hue, _, saturation = colorsys.rgb_to_hls(*_rgb(color))
        red = min(hue, 1 - hue) < 30 / 360 and saturation > 0.35
        assert red == (name == "loss"), name


def test_base_and_dynamic_have_the_same_colours_whichever_other_arms_there_are() -> None:
    assert arm_colors(["base", "dynamic"]) == {"base": ARMS[0], "dynamic": ARMS[1]}
    colors = arm_colors(["reset", "dynamic", "again"])
    assert colors == {"reset": ARMS[2], "dynamic": ARMS[1], "again": ARMS[3]}


def test_the_style_sheet_defines_each_colour_for_light_and_dark_pages() -> None:
    assert LIGHT.keys() == DARK.keys()
    light, dark = css().split("@media")
    for part, colors in ((light, LIGHT), (dark, DARK)):
        assert dict(re.findall(r"--([\w-]+):(#\w+);", part)) == colors
