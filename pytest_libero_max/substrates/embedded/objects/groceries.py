"""The groceries of LIBERO-Object and the cookie box of LIBERO-Spatial: what each looks like."""

from __future__ import annotations

import math

from pytest_libero_max.substrates.embedded.labels import Label, box_atlas
from pytest_libero_max.substrates.embedded.objects.packaging import bottle, can, carton, packet
from pytest_libero_max.substrates.embedded.objects.parts import Category
from pytest_libero_max.substrates.embedded.textures import Rgb
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.rotations import Quaternion

_HALF_TURN: Quaternion = (0.0, 0.0, 0.0, 1.0)
_QUARTER_TURN: Quaternion = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def cookies() -> Category:
    """Return a flat red box with chocolate-chip cookies on it."""
    return packet("cookies", (0.0826, 0.0621, 0.0188), 0.009643, _cookies_label, 0.0094, 0.025, _QUARTER_TURN)


def cream_cheese() -> Category:
    """Return a silver packet with a blue oval and a white curl."""
    return packet(
        "cream_cheese", (0.0812, 0.0427, 0.0179), 0.006194, _cream_cheese_label, 0.0089, 0.03, _HALF_TURN
    )


def butter() -> Category:
    """Return a yellow packet with a sliced block of butter."""
    return packet("butter", (0.0762, 0.0395, 0.0174), 0.005247, _butter_label, 0.0087, 0.02, _HALF_TURN)


def chocolate_pudding() -> Category:
    """Return a brown box with a cup of pudding and whipped cream."""
    size = (0.0802, 0.0463, 0.0274)
    return packet("chocolate_pudding", size, 0.010186, _pudding_label, 0.0131, 0.025, _HALF_TURN)


def milk() -> Category:
    """Return a white and blue carton with a splash."""
    return carton("milk", (0.0525, 0.0531, 0.1312), 0.031666, _milk_label, 0.0697, 0.03)


def orange_juice() -> Category:
    """Return an orange carton with a cut orange."""
    return carton("orange_juice", (0.0525, 0.0531, 0.1312), 0.031666, _juice_label, 0.0697, 0.025)


def alphabet_soup() -> Category:
    """Return a tin with a yellow label, a bowl of soup and loose letters."""
    return can("alphabet_soup", 0.0313, 0.0762, 0.025851, _soup_label, 0.0384)


def tomato_sauce() -> Category:
    """Return a tin with a red label and a tomato."""
    return can("tomato_sauce", 0.0311, 0.0762, 0.026633, _tomato_label, 0.0384)


def ketchup() -> Category:
    """Return a red squeeze bottle with a white cap."""
    return bottle(
        "ketchup",
        (0.0368, 0.0562, 0.1456),
        0.023217,
        _ketchup_label,
        0.0724,
        glass=(0.74, 0.07, 0.06),
        cap=(0.95, 0.95, 0.93),
        neck=0.84,
        shoulder=0.62,
        cap_width=0.026,
    )


def bbq_sauce() -> Category:
    """Return a short dark bottle with a flame."""
    return bottle(
        "bbq_sauce",
        (0.0291, 0.0470, 0.1071),
        0.01218,
        _bbq_label,
        0.0546,
        glass=(0.20, 0.09, 0.05),
        cap=(0.10, 0.10, 0.11),
        neck=0.83,
        shoulder=0.66,
        cap_width=0.022,
        margin=0.015,
        upright=_QUARTER_TURN,
    )


def salad_dressing() -> Category:
    """Return a tall creamy bottle with green leaves and a green cap."""
    return bottle(
        "salad_dressing",
        (0.0355, 0.0527, 0.1456),
        0.021785,
        _dressing_label,
        0.0727,
        glass=(0.90, 0.87, 0.66),
        cap=(0.13, 0.45, 0.17),
        neck=0.86,
        shoulder=0.58,
        cap_width=0.024,
    )


# --- their labels
# ------------------------------------------------------------------------------------------------

_WHITE: Rgb = (250, 250, 246)
_INK: Rgb = (30, 26, 24)


def _cookies_label() -> Image:
    ground: Rgb = (178, 32, 40)
    top = Label(ground, 96, 128).band(0.0, 0.06, (240, 196, 70)).band(0.94, 1.0, (240, 196, 70))
    top.word("COOKIES", 0.5, 0.2, 0.88, 0.17, _WHITE)
    for x, y in ((0.3, 0.5), (0.7, 0.56), (0.42, 0.78)):
        top.disc(x, y, 0.2, (120, 74, 32)).disc(x, y, 0.18, (208, 150, 84))
        for dx, dy in ((-0.07, -0.04), (0.06, -0.05), (0.0, 0.04), (0.09, 0.04), (-0.1, 0.05)):
            top.disc(x + dx, y + dy, 0.03, (70, 38, 18))
    side = Label(ground, 128, 32).word("COOKIES", 0.5, 0.5, 0.8, 0.7, _WHITE)
    return box_atlas({"top": top.image, "front": side.image, "bottom": Label(ground).image})


def _cream_cheese_label() -> Image:
    silver: Rgb = (216, 222, 230)
    blue: Rgb = (28, 78, 160)
    top = Label(silver, 96, 160).band(0.0, 0.12, blue).band(0.88, 1.0, blue)
    top.disc(0.5, 0.36, 0.44, blue, 0.62).word("CREAM", 0.5, 0.31, 0.7, 0.09, _WHITE)
    top.word("CHEESE", 0.5, 0.43, 0.74, 0.09, _WHITE)
    # A bagel half with a white swirl.
    top.disc(0.5, 0.71, 0.28, (190, 132, 70), 0.75).disc(0.5, 0.7, 0.23, _WHITE, 0.72).disc(
        0.5, 0.7, 0.07, (190, 132, 70)
    )
    side = Label(silver, 128, 48).band(0.0, 0.25, blue).word("CREAM CHEESE", 0.5, 0.6, 0.84, 0.44, blue)
    return box_atlas({"top": top.image, "front": side.image, "bottom": Label(silver).image})


def _butter_label() -> Image:
    yellow: Rgb = (247, 208, 60)
    red: Rgb = (190, 32, 30)
    top = Label(yellow, 96, 160).band(0.0, 0.08, red).band(0.92, 1.0, red)
    top.word("BUTTER", 0.5, 0.26, 0.8, 0.17, red)
    # A block of butter on a dish, one slice cut off.
    top.disc(0.5, 0.78, 0.44, (250, 250, 246), 0.32)
    top.polygon(
        [(0.16, 0.55), (0.3, 0.46), (0.84, 0.46), (0.84, 0.68), (0.7, 0.78), (0.16, 0.78)], (208, 152, 34)
    )
    top.block(0.16, 0.56, 0.68, 0.78, (255, 238, 160)).block(0.3, 0.56, 0.33, 0.78, (208, 152, 34))
    side = Label(yellow, 128, 48).word("BUTTER", 0.5, 0.5, 0.8, 0.6, red)
    return box_atlas({"top": top.image, "front": side.image, "bottom": Label(yellow).image})


def _pudding_label() -> Image:
    brown: Rgb = (84, 44, 26)
    sand: Rgb = (236, 200, 142)
    top = Label(brown, 96, 160).band(0.0, 0.06, sand).band(0.94, 1.0, sand)
    top.word("CHOCOLATE", 0.5, 0.16, 0.84, 0.1, sand).word("PUDDING", 0.5, 0.29, 0.8, 0.12, _WHITE)
    # A glass of pudding with whipped cream and a cherry.
    top.polygon([(0.16, 0.56), (0.84, 0.56), (0.68, 0.9), (0.32, 0.9)], (226, 228, 232))
    top.polygon([(0.22, 0.6), (0.78, 0.6), (0.65, 0.87), (0.35, 0.87)], (122, 66, 34))
    top.disc(0.5, 0.56, 0.34, (150, 86, 46), 0.3).disc(0.5, 0.5, 0.2, _WHITE, 0.7).disc(
        0.5, 0.42, 0.08, (206, 30, 40)
    )
    side = Label(brown, 128, 48).word("PUDDING", 0.5, 0.5, 0.8, 0.6, sand)
    return box_atlas({"top": top.image, "front": side.image, "bottom": Label(brown).image})


def _milk_label() -> Image:
    blue: Rgb = (36, 92, 190)
    front = Label(_WHITE, 96, 160).band(0.0, 0.14, blue).band(0.8, 1.0, blue)
    front.word("MILK", 0.5, 0.34, 0.86, 0.24, blue)
    front.disc(0.5, 0.68, 0.27, (176, 212, 246)).polygon([(0.5, 0.47), (0.36, 0.68), (0.64, 0.68)], _WHITE)
    front.disc(0.5, 0.7, 0.15, _WHITE)
    top = Label(blue, 96, 96).word("MILK", 0.5, 0.72, 0.7, 0.3, _WHITE)
    return box_atlas({"front": front.image, "top": top.image, "bottom": Label(_WHITE).image})


def _juice_label() -> Image:
    orange: Rgb = (240, 136, 24)
    front = Label(orange, 96, 160).band(0.0, 0.1, (30, 122, 52)).band(0.9, 1.0, (30, 122, 52))
    front.word("ORANGE", 0.5, 0.19, 0.86, 0.1, _WHITE).word("JUICE", 0.5, 0.32, 0.76, 0.12, _WHITE)
    front.disc(0.5, 0.62, 0.36, (252, 242, 214)).disc(0.5, 0.62, 0.31, (250, 166, 40))
    for k in range(8):
        angle = k * math.pi / 4
        x, y = 0.5 + 0.31 * math.cos(angle), 0.62 + 0.31 * 0.6 * math.sin(angle)
        front.polygon([(0.5, 0.62), (x, y), (x + 0.03, y + 0.01)], (252, 242, 214))
    front.polygon([(0.62, 0.42), (0.86, 0.36), (0.74, 0.48)], (40, 140, 60))
    top = Label((30, 122, 52), 96, 96).word("JUICE", 0.5, 0.72, 0.7, 0.3, _WHITE)
    return box_atlas({"front": front.image, "top": top.image, "bottom": Label(orange).image})


def _soup_label() -> Image:
    label = Label((250, 206, 52), 256, 112).band(0.0, 0.1, (24, 110, 66)).band(0.9, 1.0, (24, 110, 66))
    colours: tuple[Rgb, ...] = ((206, 36, 40), (30, 80, 170), (24, 110, 66))
    for middle in (0.0, 0.5, 1.0):
        label.word("SOUP", middle, 0.28, 0.26, 0.26, (176, 30, 34))
        label.disc(middle, 0.66, 0.105, _WHITE, 0.6).disc(middle, 0.66, 0.088, (226, 110, 40), 0.6)
        label.word("ABC", middle, 0.66, 0.1, 0.2, (255, 246, 200))
    for n, letter in enumerate("AZBKEC"):
        x = 0.25 + 0.5 * (n // 3) + (0.06 if n % 2 else -0.06)
        label.word(letter, x, 0.24 + 0.25 * (n % 3), 0.07, 0.22, colours[n % 3])
    return label.image


def _tomato_label() -> Image:
    label = Label((190, 26, 26), 256, 112).band(0.0, 0.09, _WHITE).band(0.9, 1.0, (36, 108, 40))
    for middle in (0.0, 0.5, 1.0):
        label.disc(middle, 0.6, 0.12, _WHITE, 0.95).disc(middle, 0.62, 0.092, (226, 52, 34), 0.9)
        label.polygon(
            [(middle - 0.06, 0.36), (middle + 0.06, 0.36), (middle + 0.02, 0.5), (middle - 0.02, 0.5)],
            (36, 128, 48),
        )
    for middle in (0.25, 0.75):
        label.word("TOMATO", middle, 0.36, 0.22, 0.24, _WHITE).word(
            "SAUCE", middle, 0.66, 0.18, 0.24, (255, 226, 120)
        )
    return label.image


def _ketchup_label() -> Image:
    label = Label((196, 20, 18), 256, 160)
    for middle in (0.0, 0.5, 1.0):
        label.disc(middle, 0.5, 0.165, _WHITE, 1.5).word("KETCHUP", middle, 0.42, 0.26, 0.16, (196, 20, 18))
        label.disc(middle, 0.63, 0.05, (214, 40, 28)).disc(middle, 0.56, 0.02, (40, 130, 50), 0.7)
    return label.image


def _bbq_label() -> Image:
    label = Label((52, 22, 14), 256, 128).band(0.12, 0.2, (240, 150, 30)).band(0.88, 0.96, (240, 150, 30))
    for middle in (0.0, 0.5, 1.0):
        label.word("BBQ", middle, 0.4, 0.28, 0.3, (250, 190, 60))
        flame = [
            (-0.07, 0.84),
            (-0.08, 0.7),
            (-0.03, 0.62),
            (0.0, 0.54),
            (0.04, 0.64),
            (0.08, 0.7),
            (0.07, 0.84),
        ]
        label.polygon([(middle + dx, y) for dx, y in flame], (232, 84, 24))
        label.disc(middle, 0.77, 0.03, (252, 200, 70), 1.1)
    return label.image


def _dressing_label() -> Image:
    label = Label((238, 232, 190), 256, 160).band(0.0, 0.07, (44, 128, 52)).band(0.93, 1.0, (44, 128, 52))
    for middle in (0.0, 0.5, 1.0):
        label.word("SALAD", middle, 0.22, 0.26, 0.17, (28, 96, 40)).word(
            "DRESSING", middle, 0.4, 0.3, 0.12, (28, 96, 40)
        )
        for dx, dy in ((-0.06, 0.7), (0.06, 0.7), (0.0, 0.62)):
            label.disc(middle + dx, dy, 0.06, (70, 160, 60), 1.5).disc(
                middle + dx, dy, 0.035, (140, 200, 90), 1.7
            )
        label.disc(middle, 0.82, 0.035, (214, 50, 40))
    return label.image
