"""The objects and fixtures of the embedded scenes, by LIBERO category."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.substrates.embedded.objects import (
    cookware,
    desk,
    dishes,
    furniture,
    groceries,
    microwave,
    mugs,
    restyled,
    wine,
)
from pytest_libero_max.substrates.embedded.objects.parts import Category

_BUILDERS: Mapping[str, Callable[[], Category]] = MappingProxyType(
    {
        build.__name__: build
        for build in (
            cookware.chefmate_8_frypan,
            cookware.moka_pot,
            desk.black_book,
            desk.desk_caddy,
            dishes.akita_black_bowl,
            dishes.glazed_rim_porcelain_ramekin,
            dishes.plate,
            furniture.basket,
            furniture.flat_stove,
            furniture.white_cabinet,
            furniture.wooden_cabinet,
            groceries.alphabet_soup,
            groceries.bbq_sauce,
            groceries.butter,
            groceries.chocolate_pudding,
            groceries.cookies,
            groceries.cream_cheese,
            groceries.ketchup,
            groceries.milk,
            groceries.orange_juice,
            groceries.salad_dressing,
            groceries.tomato_sauce,
            microwave.microwave,
            mugs.porcelain_mug,
            mugs.red_coffee_mug,
            mugs.white_yellow_mug,
            wine.wine_bottle,
            wine.wine_rack,
        )
    }
)

_OURS = MappingProxyType({"occluder_book": desk.occluder_book})
"""Objects that only source variations bring in; LIBERO does not have them."""

CATEGORIES = tuple(sorted(_BUILDERS))
"""Every category of LIBERO that can be built."""


@cache
def category(name: str) -> Category:
    """Return the design of a category, or of a relative of one (see :mod:`.restyled`).

    Raises:
        SubstrateError: There is none of that name.
    """
    style = restyled.style_of(name)
    if style is not None:
        return restyled.relative(name, style, category(style.original))
    if name in _OURS:
        return _OURS[name]()
    if name not in _BUILDERS:
        raise SubstrateError(
            f"object category={name!r} is not one we build. {did_you_mean(name, CATEGORIES)}"
        )
    return _BUILDERS[name]()
