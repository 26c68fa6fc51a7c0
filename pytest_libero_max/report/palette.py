"""The colours of films, pages, charts and figures, in one place.

Red (:data:`LOSS`) is worse and nothing else; blue-green (:data:`GAIN`) is better. Base and Dynamic have the
same two colours everywhere, and neither is one of these. Colours that stand beside each other differ for
people who see no red, no green or no blue as well, which a test computes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import cycle

from pytest_libero_max.events.schedules import BASE, DYNAMIC

LIGHT: Mapping[str, str] = {
    "paper": "#ffffff",
    "ink": "#1f2933",
    "muted": "#5b6773",
    "line": "#d8dee4",
    "panel": "#f2f5f7",
    "box": "#eceff2",
    "link": "#0b5a9d",
    "loss": "#b3421b",
    "gain": "#14708a",
    "light-gain": "#8cc5d3",
    "neutral": "#52606d",
    "grey": "#c4ccd4",
    "event": "#c98f00",
    "stale": "#f3e3bb",
    "alarm": "#fbf1d9",
    "arm0": "#52606d",
    "arm1": "#7a3fd0",
    "arm2": "#2b6fd6",
    "arm3": "#6d4c41",
    "run0": "#1f2933",
    "run1": "#2b6fd6",
    "run2": "#7a8b00",
    "run3": "#b07a00",
    "run4": "#5b6773",
    "run5": "#00897b",
    "run6": "#6d4c41",
    "run7": "#c2559c",
}
"""Colours on a light ground by their meaning: those of films, of figures, and of light pages."""

DARK: Mapping[str, str] = {
    "paper": "#14181d",
    "ink": "#e3e8ed",
    "muted": "#a3afbb",
    "line": "#36404a",
    "panel": "#1f262d",
    "box": "#2a333c",
    "link": "#7cb8f0",
    "loss": "#f0825a",
    "gain": "#5cb8d1",
    "light-gain": "#2f6d80",
    "neutral": "#9fb0bf",
    "grey": "#4a5561",
    "event": "#e5b53c",
    "stale": "#4f4222",
    "alarm": "#3a2f14",
    "arm0": "#9fb0bf",
    "arm1": "#a06cff",
    "arm2": "#6ea8ff",
    "arm3": "#bc9a8e",
    "run0": "#e3e8ed",
    "run1": "#6ea8ff",
    "run2": "#c0ca33",
    "run3": "#e5b53c",
    "run4": "#8e9ba8",
    "run5": "#4db6ac",
    "run6": "#bc9a8e",
    "run7": "#e79ccb",
}
"""The same names on a dark ground."""

PAPER, INK, MUTED, GRID, BOX = (LIGHT[name] for name in ("paper", "ink", "muted", "line", "box"))
LOSS, GAIN, LIGHT_GAIN, NEUTRAL = (LIGHT[name] for name in ("loss", "gain", "light-gain", "neutral"))
EVENT, EVENT_INK, STALE = LIGHT["event"], "#8a6100", LIGHT["stale"]

ARMS = tuple(LIGHT[f"arm{number}"] for number in range(4))
"""Colours of arms: Base, Dynamic, then others in their order."""

SECOND = LIGHT["run1"]
"""Colour of the second of two things beside :data:`INK`, of which neither is better nor an arm."""

ON_LIGHT = "#1a2129"
"""Ink on a shape that is light on dark pages as well, which give :data:`INK` another colour."""


def arm_kinds(names: Collection[str]) -> dict[str, str]:
    """Return the name of the colour of each arm, by its name: those of Base and Dynamic never change."""
    others = cycle(range(2, len(ARMS)))
    known = {BASE: 0, DYNAMIC: 1}
    return {name: f"arm{known[name] if name in known else next(others)}" for name in names}


def arm_colors(names: Collection[str]) -> dict[str, str]:
    """Return the colour of each arm by its name."""
    return {name: LIGHT[kind] for name, kind in arm_kinds(names).items()}


def css() -> str:
    """Return the colours as variables of a style sheet, and what turns drawings in the light ones dark.

    A colour of :data:`LIGHT` that has several names gets the dark one of the first.
    """
    light, dark = (
        "".join(f"--{name}:{color};" for name, color in colors.items()) for colors in (LIGHT, DARK)
    )
    names: dict[str, str] = {}
    for name, color in LIGHT.items():
        names.setdefault(color, name)
    drawn = "".join(
        f'svg [{part}="{color}"]{{{part}:var(--{name})}}'
        for color, name in names.items()
        if name != "paper"
        for part in ("fill", "stroke")
    )
    return (
        f":root{{color-scheme:light dark;{light}}}\n"
        f"@media (prefers-color-scheme:dark){{:root{{{dark}}}{drawn}}}\n"
    )
