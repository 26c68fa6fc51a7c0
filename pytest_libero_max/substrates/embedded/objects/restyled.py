"""Relatives of the categories: the same thing in another colour or another size.

A relative has the shape of its original, so it is handled like it; its name follows LIBERO-PRO's where that
has one. ``small_<category>`` exists for every category.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import cast

import numpy as np

from pytest_libero_max.substrates.embedded.objects.parts import Category, Colour, Link, Skin, Vector
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Image

SMALL = "small_"
SMALL_SCALE = 0.7
"""Size of a small object against its original. Half, as LIBERO-PRO intends, would leave flat packets 9 mm
high, which no finger grips."""

SMALL_FIXTURE_SCALE = (0.85, 1.0, 1.0)
"""Fixtures get narrower only: the thresholds of open and closed depend on the travel of drawers and doors."""


@dataclass(frozen=True)
class Style:
    """Difference of a relative: colour (RGB 0 to 1) in place of its original's, or size."""

    original: str
    colour: Colour | None = None
    scale: Vector = (1.0, 1.0, 1.0)


STYLES: Mapping[str, Style] = MappingProxyType(
    {
        "bigger_akita_black_bowl": Style("akita_black_bowl", scale=(1.2, 1.2, 1.2)),
        "bigger_alphabet_soup": Style("alphabet_soup", scale=(1.15, 1.15, 1.15)),
        "black_bowl": Style("akita_black_bowl", (0.30, 0.33, 0.40), (0.92, 0.92, 0.92)),
        "blue_ketchup": Style("ketchup", (0.12, 0.28, 0.80)),
        "brown_rack": Style("wine_rack", (0.36, 0.20, 0.10)),
        "green_bbq_sauce": Style("bbq_sauce", (0.16, 0.52, 0.20)),
        "green_butter": Style("butter", (0.30, 0.70, 0.26)),
        "green_chocolate_pudding": Style("chocolate_pudding", (0.22, 0.58, 0.28)),
        "red_basket": Style("basket", (0.78, 0.14, 0.12)),
        "red_cream_cheese": Style("cream_cheese", (0.84, 0.16, 0.16)),
        "red_salad_dressing": Style("salad_dressing", (0.84, 0.18, 0.14)),
        "white_bottle": Style("wine_bottle", (0.94, 0.94, 0.90)),
        "yellow_book": Style("black_book", (0.92, 0.76, 0.14)),
        "yellow_cabinet": Style("wooden_cabinet", (0.94, 0.78, 0.18)),
        "yellow_milk": Style("milk", (0.98, 0.84, 0.22)),
        "yellow_moka_pot": Style("moka_pot", (0.94, 0.78, 0.16)),
        "yellow_plate": Style("plate", (0.98, 0.82, 0.16)),
        "yellow_stove": Style("flat_stove", (0.92, 0.76, 0.16)),
        "yellow_tomato_sauce": Style("tomato_sauce", (0.96, 0.80, 0.18)),
    }
)
"""Relatives by name."""


def style_of(name: str) -> Style | None:
    """Difference of a relative from its original; None for a name that is no relative's."""
    if name.startswith(SMALL):
        return Style(name.removeprefix(SMALL), scale=(SMALL_SCALE,) * 3)
    return STYLES.get(name)


def relative(name: str, style: Style, original: Category) -> Category:
    """Return the category ``name``: its original in another colour, another size or both."""
    kind = original
    if style.colour is not None:
        kind = _coloured(kind, style.colour)
    scale = SMALL_FIXTURE_SCALE if kind.fixture and name.startswith(SMALL) else style.scale
    if scale != (1.0, 1.0, 1.0):
        kind = _sized(kind, scale)
    return replace(kind, name=name)


def _coloured(kind: Category, colour: Colour) -> Category:
    def painter(draw: Callable[[], Image]) -> Callable[[], Image]:
        return lambda: _painted(draw(), colour)

    return replace(
        kind,
        textures={key: painter(draw) for key, draw in kind.textures.items()},
        root=_each(kind.root, lambda link: replace(link, skins=_painted_skins(link, colour))),
    )


def _painted_skins(link: Link, colour: Colour) -> tuple[Skin, ...]:
    # A skin with a texture multiplies it; the texture is painted, so its skin turns white.
    white = (1.0, 1.0, 1.0)
    return tuple(
        replace(skin, colour=white if skin.texture is not None else _shade(colour, max(skin.colour)))
        for skin in link.skins
    )


def _shade(colour: Colour, brightness: float) -> Colour:
    """Return a colour as dark as the replaced one, but not too dark to be recognised."""
    r, g, b = (part * (0.45 + 0.55 * brightness) for part in colour)
    return r, g, b


def _painted(picture: Image, colour: Colour) -> Image:
    """Return the picture in shades of one colour: lettering stays legible by its brightness."""
    grey = picture.astype(np.float64).max(axis=2, keepdims=True) / 255.0
    shades = np.asarray(colour) * (0.45 + 0.55 * grey)
    painted: Image = np.rint(shades * 255.0).clip(0, 255).astype(np.uint8)
    return painted


def _sized(kind: Category, scale: Vector) -> Category:
    x, y, z = scale
    return replace(
        kind,
        root=_each(kind.root, lambda link: _sized_link(link, np.asarray(scale))),
        origin_height=kind.origin_height * z,
        spread_margin=kind.spread_margin * max(x, y),
    )


def _each(link: Link, change: Callable[[Link], Link]) -> Link:
    """Return a link with ``change`` made to it and to everything attached to it."""
    changed = change(link)
    return replace(changed, links=tuple(_each(child, change) for child in link.links))


def _sized_link(link: Link, scale: np.ndarray) -> Link:
    return replace(
        link,
        mass=link.mass * float(np.prod(scale)),
        pos=_times(link.pos, scale),
        solids=tuple(
            replace(solid, pos=_times(solid.pos, scale), half=_along(solid.half, solid.quat, scale))
            for solid in link.solids
        ),
        skins=tuple(
            replace(skin, mesh=skin.mesh.moved(scale=cast(Vector, tuple(scale)))) for skin in link.skins
        ),
        sites=tuple(
            replace(site, pos=_times(site.pos, scale), half=_along(site.half, site.quat, scale))
            for site in link.sites
        ),
        grips=tuple(replace(grip, pos=_times(grip.pos, scale)) for grip in link.grips),
    )


def _times(vector: Vector, scale: np.ndarray) -> Vector:
    x, y, z = (float(a * b) for a, b in zip(vector, scale, strict=True))
    return x, y, z


def _along(half: Vector, quat: rotations.Quaternion, scale: np.ndarray) -> Vector:
    """Half sizes in a turned frame, scaled along the axes outside it."""
    stretch = np.linalg.norm(rotations.matrix(quat).T * scale, axis=1)
    return _times(half, stretch)
