"""The objects and fixtures of the embedded scenes, by LIBERO category."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.worlds.embedded.objects import dishes, furniture, groceries, wine
from pytest_libero_max.worlds.embedded.objects.base import Category

_BUILDERS: dict[str, Callable[[], Category]] = {
    build.__name__: build
    for build in (
        dishes.akita_black_bowl,
        dishes.glazed_rim_porcelain_ramekin,
        dishes.plate,
        furniture.basket,
        furniture.flat_stove,
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
        wine.wine_bottle,
        wine.wine_rack,
    )
}

CATEGORIES = tuple(sorted(_BUILDERS))
"""Every category that can be built."""


@cache
def category(name: str) -> Category:
    """The design of a category.

    Raises:
        SubstrateError: There is none of that name.
    """
    if name not in _BUILDERS:
        raise SubstrateError(
            f"object category={name!r} is not one we build. {did_you_mean(name, CATEGORIES)}"
        )
    return _BUILDERS[name]()
