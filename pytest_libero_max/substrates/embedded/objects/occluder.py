"""What stands in the way of a camera: a book on end, taller than most of what is behind it."""

from __future__ import annotations

from pytest_libero_max.substrates.embedded.labels import Label, box_atlas
from pytest_libero_max.substrates.embedded.objects.base import Category
from pytest_libero_max.substrates.embedded.objects.packaging import packet
from pytest_libero_max.substrates.embedded.textures import Rgb
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.rotations import IDENTITY

_SIZE = (0.030, 0.100, 0.115)


def occluder_book() -> Category:
    """A black book that stands upright, its cover towards ``agentview``."""
    return packet("occluder_book", _SIZE, 0.18, _cover, _SIZE[2] / 2, 0.03, IDENTITY)


def _cover() -> Image:
    black: Rgb = (30, 30, 34)
    gold: Rgb = (206, 170, 84)
    page: Rgb = (236, 230, 214)
    front = Label(black, 96, 112).band(0.08, 0.10, gold).band(0.90, 0.92, gold)
    front.word("BLACK", 0.5, 0.36, 0.66, 0.13, gold).word("BOOK", 0.5, 0.56, 0.54, 0.13, gold)
    top = Label(page, 96, 32).band(0.0, 0.14, black).band(0.86, 1.0, black)
    side = Label(page, 32, 112).block(0.0, 0.0, 0.14, 1.0, black).block(0.86, 0.0, 1.0, 1.0, black)
    spine = Label(black, 32, 112).band(0.08, 0.10, gold).band(0.90, 0.92, gold)
    faces = {"front": front.image, "back": Label(black).image, "top": top.image, "bottom": top.image}
    return box_atlas({**faces, "right": side.image, "left": spine.image})
