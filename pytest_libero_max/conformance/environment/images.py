"""Rules for images: which way up, in which order of colours, of which state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.environment.contract import KEYS
from pytest_libero_max.conformance.environment.reference import shrink
from pytest_libero_max.conformance.environment.subject import EnvironmentSubject, copied, images_of, settled
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined

Array = NDArray[np.float64]

TURNS: dict[str, Callable[[Array], Array]] = {
    "delivered": lambda image: image,
    "flipped": lambda image: image[::-1],
    "mirrored": lambda image: image[:, ::-1],
    "rotated": lambda image: image[::-1, ::-1],
}
"""Orientations of an image beside that which LIBERO delivers; each is its own inverse."""

_WORDS = {
    "delivered": "as LIBERO delivers it, bottom row first",
    "flipped": "flipped upside down",
    "mirrored": "mirrored left to right",
    "rotated": "rotated by 180 degrees",
}

_CLEARLY = 0.8
"""Largest part of the next best difference that the best one may be, to be called the best."""

_ALIKE = 8.0
"""Largest mean difference of small images of the same scene, of 255 levels."""


class Match(NamedTuple):
    """The orientation and the order of colours in which an image is most like that of LIBERO."""

    turn: str
    swapped: bool
    """True if red and blue are exchanged."""
    levels: float
    """Mean difference that is left, 0 to 255."""
    clear: bool
    """True if no other orientation is nearly as good."""


def matches(subject: EnvironmentSubject) -> dict[str, Match]:
    """Return the match of each camera's image of the settled state."""
    reading = subject.once(settled)
    return {
        camera: _match(shrink(image), subject.reference.picture(camera))
        for camera, image in images_of(reading).items()
    }


def _match(image: Array, meant: Array) -> Match:
    levels = {
        (turn, swapped): float(np.abs(turned(image[..., ::-1] if swapped else image) - meant).mean())
        for turn, turned in TURNS.items()
        for swapped in (False, True)
    }
    turn, swapped = min(levels, key=lambda each: levels[each])
    best = levels[turn, swapped]
    others = min(value for (name, _), value in levels.items() if name != turn)
    return Match(turn, swapped, best, best <= _CLEARLY * others)


@rule("env/images/orientation", "must", needs=KEYS)
def orientation(subject: EnvironmentSubject) -> Iterator[Finding]:
    """Show images the way up that is declared, by default as LIBERO delivers them."""
    declared = subject.declared.images
    for camera, match in subject.once(matches).items():
        if not match.clear:
            yield unexamined("no orientation makes it clearly more like LIBERO's image", part=camera)
        else:
            yield judged(
                match.turn == declared,
                f"{_WORDS[match.turn]} (mean difference {match.levels:.1f} of 255)",
                f"{_WORDS[declared]}, as declared",
                "Policies rotate what LIBERO delivers by 180 degrees. Do it in one place, and declare "
                "images= where it is this one.",
                part=camera,
            )


@rule("env/images/colours", "must", needs=KEYS)
def colours(subject: EnvironmentSubject) -> Iterator[Finding]:
    """Have red first and blue last."""
    for camera, match in subject.once(matches).items():
        yield judged(
            not match.swapped,
            "blue and red are exchanged" if match.swapped else "RGB",
            "RGB",
            "OpenCV reads and writes BGR: convert with image[..., ::-1].",
            part=camera,
        )


@rule("env/images/content", "should", needs=KEYS)
def content(subject: EnvironmentSubject) -> Iterator[Finding]:
    """Show the scene that LIBERO shows, with its textures, light and camera."""
    for camera, match in subject.once(matches).items():
        yield judged(
            match.levels <= _ALIKE,
            f"mean difference {match.levels:.1f} of 255",
            f"at most {_ALIKE:g}, as between versions of MuJoCo",
            "Other models, textures, light or camera: compare the versions with those of the reference.",
            part=camera,
        )


@rule("env/images/fresh", "must", needs=KEYS)
def fresh(subject: EnvironmentSubject) -> Finding:
    """Show another image after each step in which the hand moves."""
    before = images_of(copied(subject.begin(drawn=True)))
    for number in range(4):
        after = images_of(subject.step((1.0, 0.5, -0.5, 0.0, 0.0, 0.0, -1.0)).reading)
        old = [camera for camera, image in after.items() if np.array_equal(image, before[camera])]
        if old:
            return broken(
                f"after step {number + 1} of a movement, {', '.join(old)} is the image before it",
                "an image of the new state",
                "An old image is returned: draw after the step.",
            )
        before = {camera: np.array(image) for camera, image in after.items()}
    return kept("each step of a movement has another image")
