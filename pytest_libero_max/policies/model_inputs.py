"""Inputs that a policy gives its model: camera, orientation, order of colours, rule for the rotation.

Only a policy that offers ``model_inputs(observation, query)`` can be examined. Its inputs are compared with
an observation whose images are marked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.contract import Policy, Query
from pytest_libero_max.policies.finding import Finding, note, ok, wrong
from pytest_libero_max.policies.transforms import states
from pytest_libero_max.worlds.contract import CAMERAS, Image, Observation

_TURNS: Mapping[str, Callable[[Image], Image]] = MappingProxyType(
    {
        "as delivered, bottom row first": lambda image: image,
        "rotated by 180 degrees": lambda image: image[::-1, ::-1],
        "flipped upside down ([::-1])": lambda image: image[::-1],
        "mirrored left to right ([:, ::-1])": lambda image: image[:, ::-1],
        "transposed": lambda image: image.transpose(1, 0, 2),
    }
)
USUAL = "rotated by 180 degrees"


def model_inputs(policy: Policy, observation: Observation, query: Query) -> dict[str, NDArray[Any]] | None:
    """Return the arrays that a policy hands to its model, by name; None where it does not offer them."""
    tell = getattr(policy, "model_inputs", None)
    if tell is None:
        return None
    try:
        told = dict(tell(observation, query))
    except Exception as error:  # an adapter may raise anything
        raise AdapterError(
            f"policy {policy.spec.name!r} raised {type(error).__name__} in model_inputs: {error}. Repair "
            "the adapter."
        ) from error
    return {str(key): np.asarray(value) for key, value in told.items()}


def as_image(array: NDArray[Any]) -> Image | None:
    """(H, W, 3) uint8 of an image in any usual form; None of anything else."""
    while array.ndim > 3 and array.shape[0] == 1:
        array = array[0]
    if array.ndim != 3 or array.dtype.kind not in "fu":
        return None
    if array.shape[2] != 3 and array.shape[0] == 3:
        array = np.moveaxis(array, 0, 2)
    if array.shape[2] != 3 or min(array.shape[:2]) < 8:
        return None
    if array.dtype.kind == "f":
        low = -1.0 if array.min() < -1e-3 else 0.0
        array = (array - low) / (1.0 - low) * 255.0
    pixels: Image = np.clip(np.rint(array), 0, 255).astype(np.uint8)
    return pixels


def marked_observation(observation: Observation) -> dict[str, NDArray[Any]]:
    """Return an observation with marked images, another for each camera, and a quaternion with w < 0."""
    marked = {key: np.array(value) for key, value in observation.items()}
    for number, camera in enumerate(CAMERAS):
        key = f"{camera}_image"
        if key in marked:
            height, width = marked[key].shape[:2]
            rows, columns = np.indices((height, width)) // max(1, height // 8)
            image = np.zeros((height, width, 3))
            image[:, :, number] = 20 + 25 * rows
            image[:, :, 2] = 15 * columns
            image[: height // 4, : width // 4] = (250, 40, 90) if number else (200, 120, 10)
            marked[key] = np.clip(image, 0, 255).astype(np.uint8)
    marked["robot0_eef_quat"] = np.array([0.64, 0.288, 0.384, -0.6])
    return marked


def compare_inputs(told: Mapping[str, NDArray[Any]], observation: Observation) -> Iterator[Finding]:
    """Compare the inputs of a model with the observation that they were made from.

    Args:
        told: The result of :func:`model_inputs`.
        observation: A marked one, see :func:`marked_observation`.
    """
    names = iter(CAMERAS)
    for name, array in told.items():
        image = as_image(array)
        if image is not None:
            for part, half in _halves(name, image, observation):
                yield from _one_image(part, half, observation, next(names, None))
        elif array.dtype.kind == "f":
            yield from _one_state(name, array.ravel(), observation)


def _halves(name: str, image: Image, observation: Observation) -> list[tuple[str, Image]]:
    """Split an image twice as wide as high into two, side by side, unless the world delivers such images."""
    height, width = image.shape[:2]
    delivered = (value.shape[:2] for key, value in observation.items() if key.endswith("_image"))
    if width != 2 * height or any(high * 2 == wide for high, wide in delivered):
        return [(name, image)]
    return [(f"{name}, left", image[:, :height]), (f"{name}, right", image[:, height:])]


def _one_image(name: str, image: Image, observation: Observation, meant: str | None) -> Iterator[Finding]:
    from pytest_libero_max.policies.transforms.images import resize_area

    side = 32
    small = resize_area(image, side).astype(float)
    best: tuple[float, str, str, bool] = (np.inf, "", "", False)
    for camera in CAMERAS:
        source = observation.get(f"{camera}_image")
        if source is None:
            continue
        for turn, apply in _TURNS.items():
            turned = resize_area(np.ascontiguousarray(apply(source)), side).astype(float)
            for reversed_colours in (False, True):
                seen = turned[:, :, ::-1] if reversed_colours else turned
                distance = float(np.abs(seen - small).mean())
                best = min(best, (distance, camera, turn, reversed_colours))
    distance, camera, turn, reversed_colours = best
    where = f"input {name!r}"
    if distance > 12.0:
        yield note(where, "is like no camera's image in any orientation", mistake="Look at the picture.")
        return
    if reversed_colours:
        yield wrong(
            where,
            "has blue and red exchanged",
            "RGB, as the world delivers it",
            "OpenCV reads and writes BGR: turn the channels with [:, :, ::-1].",
        )
    expected_camera = _camera_named(name) or meant
    if expected_camera is not None and camera != expected_camera:
        yield wrong(
            where,
            f"is the image of {camera}",
            f"that of {expected_camera}, by its name or place",
            "The two cameras may be exchanged.",
        )
    if turn != USUAL:
        yield note(
            where,
            f"is {turn}",
            f"{USUAL}, unless the model was trained otherwise",
            "If its own evaluation code turns images by [::-1, ::-1], do so too: no error tells.",
        )
    elif not reversed_colours:
        yield ok(where, f"{camera}, {turn}")


def picture_sheet(told: Mapping[str, NDArray[Any]]) -> Image:
    """Return the images among a model's inputs, side by side with their names, each 256 pixels high.

    Args:
        told: Arrays by name; those that are not images are left out.

    Raises:
        AdapterError: There is no image.
    """
    from PIL import Image as pillow
    from PIL import ImageDraw

    images = [(name, image) for name, array in told.items() if (image := as_image(array)) is not None]
    if not images:
        raise AdapterError("There is no image among what the model is shown.")
    side, margin = 256, 20
    widths = [max(side, round(side * image.shape[1] / image.shape[0])) for _, image in images]
    sheet = pillow.new("RGB", (sum(widths), side + margin), "white")
    pen, left = ImageDraw.Draw(sheet), 0
    for (name, image), width in zip(images, widths, strict=True):
        sheet.paste(pillow.fromarray(np.ascontiguousarray(image)).resize((width, side)), (left, margin))
        pen.text((left + 4, 4), name, fill="black")
        left += width
    return np.asarray(sheet)


def _camera_named(name: str) -> str | None:
    lower = name.lower()
    if any(word in lower for word in ("wrist", "hand")):
        return CAMERAS[1]
    return CAMERAS[0] if any(word in lower for word in ("agent", "full", "base", "front", "scene")) else None


def _one_state(name: str, values: NDArray[Any], observation: Observation) -> Iterator[Finding]:
    q = observation["robot0_eef_quat"]
    rules = {
        "kept": states.axis_angle(q),
        "antipodal": states.axis_angle_antipodal(q),
        "w first": states.axis_angle(np.roll(q, 1)),
        "w first, antipodal": states.axis_angle_antipodal(np.roll(q, 1)),
        "taken for w, x, y, z": states.axis_angle(np.roll(q, -1)),
    }
    windows = [values[i : i + 3] for i in range(len(values) - 2)]
    found = [
        rule for rule, vector in rules.items() if any(np.allclose(w, vector, atol=1e-4) for w in windows)
    ]
    where = f"input {name!r}"
    if "kept" in found:
        yield ok(where, "orientation as axis times angle, the sign of the quaternion kept")
    elif "antipodal" in found:
        yield note(
            where,
            "orientation as axis times angle of at most pi (antipodal rule)",
            "the sign kept, as robosuite has it, unless the model was trained otherwise",
            "pytest_libero_max.transforms.axis_angle keeps it.",
        )
    elif found:
        yield wrong(
            where,
            "orientation from a quaternion read in the wrong order",
            "x, y, z, w",
            "robot0_eef_quat has w last.",
        )
