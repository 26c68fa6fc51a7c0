"""The black book, the desk caddy with its four compartments, and a book on end that blocks the view."""

from __future__ import annotations

import math

from pytest_libero_max.substrates.embedded import textures
from pytest_libero_max.substrates.embedded.labels import Label, box_atlas
from pytest_libero_max.substrates.embedded.meshes import box
from pytest_libero_max.substrates.embedded.objects.packaging import packet
from pytest_libero_max.substrates.embedded.objects.parts import (
    Category,
    Grip,
    Link,
    Site,
    Skin,
    slab,
    slab_mesh,
)
from pytest_libero_max.substrates.embedded.textures import Rgb
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.rotations import IDENTITY

_HALF = math.sqrt(0.5)
_OCCLUDER = (0.030, 0.100, 0.115)


def black_book() -> Category:
    """Return a black book standing on its lower edge, 29 x 110 x 134 mm, its spine at +y."""
    low, high = (-0.0148, -0.0673, 0.0022), (0.0139, 0.0430, 0.1366)
    cover = slab(low, high)
    x, y, z = cover.pos
    grip = Grip("spine", (x, y + 0.010, high[2] - 0.020), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 2 * cover.half[0])
    return Category(
        "black_book",
        Link(
            "main",
            0.042547,
            (cover,),
            (Skin(box(cover.half, 0.0012).moved((x, y, z)), texture="cover", shine=0.3),),
            grips=(grip,),
        ),
        origin_height=-low[2],
        textures={"cover": _cover},
        # Its category and its region in LIBERO each turn it by 45 to 90 degrees.
        turn=(-math.pi, -math.pi / 2),
    )


def _cover() -> Image:
    black: Rgb = (24, 24, 27)
    gold: Rgb = (206, 166, 74)
    paper: Rgb = (236, 228, 206)
    front = Label(black, 96, 128)
    for inset, colour in ((0.06, gold), (0.085, black)):
        front.block(inset, inset * 0.75, 1 - inset, 1 - inset * 0.75, colour)
    front.word("THE", 0.5, 0.2, 0.3, 0.09, gold).word("BOOK", 0.5, 0.36, 0.66, 0.14, gold)
    front.disc(0.5, 0.66, 0.16, gold).disc(0.5, 0.66, 0.13, black).disc(0.5, 0.66, 0.05, gold)
    spine = Label(black, 48, 128).band(0.08, 0.11, gold).band(0.86, 0.89, gold)
    for k, letter in enumerate("BOOK"):
        spine.word(letter, 0.5, 0.24 + 0.16 * k, 0.4, 0.11, gold)
    leaves = Label(paper, 48, 128).block(0.0, 0.0, 0.12, 1.0, black).block(0.88, 0.0, 1.0, 1.0, black)
    for k in range(6):
        leaves.block(0.2 + 0.11 * k, 0.0, 0.23 + 0.11 * k, 1.0, (206, 196, 170))
    # On top the covers lie at the picture's upper and lower edge (-x and +x), the spine at its right (+y).
    top = (
        Label(paper, 128, 48).band(0.0, 0.12, black).band(0.88, 1.0, black).block(0.94, 0.0, 1.0, 1.0, black)
    )
    for k in range(6):
        top.band(0.2 + 0.11 * k, 0.23 + 0.11 * k, (206, 196, 170))
    return box_atlas(
        {
            "front": front.image,
            "back": front.image,
            "right": spine.image,
            "left": leaves.image,
            "top": top.image,
            "bottom": top.image,
        }
    )


def desk_caddy() -> Category:
    """Return a wooden desk organiser, 0.43 m wide, with a box at each end.

    Between them are a tall compartment at the back (+x), where a book stands, and a low one in front of it.
    """
    x, y, low, high = 0.0755, 0.2169, 0.0014, 0.1683
    wall, floor, inner = 0.006, 0.010, 0.0730
    split = 0.003
    boards = (
        slab((-x, -y, low), (x, y, floor)),
        # Front: low all along.
        slab((-x, -y, floor), (-x + wall, y, 0.074)),
        # Back: high behind the boxes at the ends, lower in the middle to leave room for fingers.
        slab((x - wall, -y, floor), (x, -inner, high)),
        slab((x - wall, inner, floor), (x, y, high)),
        slab((x - wall, -inner, floor), (x, inner, 0.128)),
        # Ends, and the walls towards the middle.
        *(slab((-x + wall, s, floor), (x - wall, s + wall, 0.112)) for s in (-y, y - wall)),
        *(slab((-x + wall, s, floor), (x - wall, s + wall, 0.112)) for s in (-inner, inner - wall)),
        # Between the tall and the low compartment; the tall one has a raised floor.
        slab((split, -inner + wall, floor), (split + wall, inner - wall, 0.112)),
        slab((split + wall, -inner + wall, floor), (x - wall, inner - wall, 0.028)),
    )
    turned = (0.0, 0.0, 1.0, 0.0)
    sites = (
        Site("right_contain_region", (0.00631, -0.14339, 0.06558), (0.06196, 0.06216, 0.06046), turned),
        Site("left_contain_region", (0.00631, 0.14551, 0.06558), (0.06196, 0.06216, 0.06046), turned),
        Site("back_contain_region", (0.03364, -0.00064, 0.08558), (0.02775, 0.06216, 0.06046), turned),
        Site(
            "front_contain_region",
            (-0.03102, -0.00064, 0.04054),
            (0.02775, 0.03595, 0.06216),
            (0.0, 0.0, _HALF, -_HALF),
        ),
    )
    skins = (
        Skin(slab_mesh(boards[:1] + boards[-1:], 0.14), (0.72, 0.64, 0.54), "wood", 0.1),
        Skin(slab_mesh(boards[1:-1], 0.14), (1.0, 1.0, 1.0), "wood", 0.1),
    )
    return Category(
        "desk_caddy",
        Link("main", 0.277963, boards, skins, sites),
        fixture=True,
        textures={"wood": lambda: textures.wood(128, (196, 156, 104), (232, 200, 150), seed=19)},
        lift=0.015,
    )


def occluder_book() -> Category:
    """Return a black book that stands upright, its cover towards ``agentview``."""
    return packet("occluder_book", _OCCLUDER, 0.18, _occluder_cover, _OCCLUDER[2] / 2, 0.03, IDENTITY)


def _occluder_cover() -> Image:
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
