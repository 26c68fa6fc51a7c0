"""Inputs that a policy gives its model: camera, orientation, order of colours, rule for the rotation.

Only a policy that offers ``model_inputs(observation, query)`` can be examined. Its inputs are compared with
an observation whose images are marked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.contract import Policy, Query
from pytest_libero_max.policies.transforms import states
from pytest_libero_max.worlds.contract import Image, Observation
from pytest_libero_max.worlds.robot import CAMERAS

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

INPUTS = ("orientation and colours of images", "which camera is which", "orientation of the hand")
"""Attributes of the inputs that are compared; others are not."""

_SAMPLES = 32

_FARTHEST = 12.0
"""Largest mean difference of two images of the same view, of 255."""


def model_inputs(policy: Policy, observation: Observation, query: Query) -> dict[str, NDArray[Any]] | None:
    """Return the arrays that a policy hands to its model, by name; None where it does not offer them."""
    tell = getattr(policy, "model_inputs", None)
    if tell is None:
        return None
    try:
        inputs = dict(tell(observation, query))
    except Exception as error:  # an adapter may raise anything
        raise AdapterError(
            f"policy {policy.spec.name!r} raised {type(error).__name__} in model_inputs: {error}. Repair "
            "the adapter."
        ) from error
    return {str(key): np.asarray(value) for key, value in inputs.items()}


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


class View(NamedTuple):
    """Content of an image: a camera's image, turned, whole or a part of it, with its colours or exchanged."""

    camera: str
    turn: str
    whole: bool
    reversed_colours: bool


class ImageInput(NamedTuple):
    """An image among the inputs of a model that was recognised."""

    name: str
    view: View
    meant: str | None
    """Camera that its name or place stands for; None where neither says."""


class StateInput(NamedTuple):
    """An orientation of the hand among the inputs of a model."""

    name: str
    form: str
    """How it is written, in words."""
    verdict: Literal["sound", "antipodal", "w_first", "misread"]


@dataclass(frozen=True)
class Inputs:
    """What was recognised among the inputs of a model."""

    names: tuple[str, ...] = ()
    """Names of all inputs."""
    images: tuple[ImageInput, ...] = ()
    states: tuple[StateInput, ...] = ()
    unrecognised: tuple[str, ...] = ()
    """Names of images that are like no camera's."""
    missing: tuple[str, ...] = ()
    """Cameras of which no image was recognised."""


def read_inputs(inputs: Mapping[str, NDArray[Any]], observation: Observation) -> Inputs:
    """Recognise the observation from which the inputs of a model were made."""
    places = iter(CAMERAS)
    views = {
        camera: _views(observation[f"{camera}_image"])
        for camera in CAMERAS
        if f"{camera}_image" in observation
    }
    recognised, states, unrecognised = [], [], []
    for name, array in inputs.items():
        images = _images(name, array, observation)
        for part, image in images:
            # Frames of one camera have one place among the inputs.
            place = next(places, None) if len(images) < 2 or "," in part else None
            view = _nearest(image, views)
            if view is None:
                unrecognised.append(part)
            else:
                recognised.append(ImageInput(part, view, _camera_named(part) or place))
        if not images and array.dtype.kind == "f":
            state = _orientation(name, array.ravel(), observation)
            states += [] if state is None else [state]
    cameras = {image.view.camera for image in recognised}
    missing = tuple(camera for camera in views if camera not in cameras)
    return Inputs(tuple(inputs), tuple(recognised), tuple(states), tuple(unrecognised), missing)


def _images(name: str, array: NDArray[Any], observation: Observation) -> list[tuple[str, Image]]:
    """Return the images of an input by name: one, two side by side, or the frames of a stack."""
    image = as_image(array)
    if image is not None:
        return _halves(name, image, observation)
    if array.ndim < 4:
        return []
    frames = [as_image(frame) for frame in array.reshape(-1, *array.shape[-3:])]
    return [(f"{name}[{index}]", frame) for index, frame in enumerate(frames) if frame is not None]


def _halves(name: str, image: Image, observation: Observation) -> list[tuple[str, Image]]:
    """Split an image twice as wide as high into two, side by side, unless the world delivers such images."""
    height, width = image.shape[:2]
    delivered = (value.shape[:2] for key, value in observation.items() if key.endswith("_image"))
    if width != 2 * height or any(high * 2 == wide for high, wide in delivered):
        return [(name, image)]
    return [(f"{name}, left", image[:, :height]), (f"{name}, right", image[:, height:])]


def _views(source: Image) -> dict[str, NDArray[np.float32]]:
    """Return the parts of an image, from half its height and width on, by turn: (15, 15, S, S, 3)."""
    from pytest_libero_max.policies.transforms.images import resize_area

    side = 2 * _SAMPLES
    spans = [(first, last) for first in range(5) for last in range(first + 4, 9)]
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    places = np.array([(first + (last - first) * steps) * side / 8 for first, last in spans]).astype(int)
    views = {}
    for turn, apply in _TURNS.items():
        turned = resize_area(np.ascontiguousarray(apply(source)), side).astype(np.float32)
        views[turn] = turned[places[:, None, :, None], places[None, :, None, :]]
    return views


def _nearest(image: Image, views: Mapping[str, Mapping[str, NDArray[np.float32]]]) -> View | None:
    """Return the view that an image shows; None where it is like none."""
    from pytest_libero_max.policies.transforms.images import resize_area

    small = resize_area(image, _SAMPLES).astype(np.float32)
    best: tuple[float, View | None] = (_FARTHEST, None)
    for camera, turns in views.items():
        for turn, parts in turns.items():
            for reversed_colours in (False, True):
                seen = small[:, :, ::-1] if reversed_colours else small
                distances = np.abs(parts - seen).mean(axis=(2, 3, 4))
                if (least := float(distances.min())) < best[0]:
                    whole = least == distances[_WHOLE, _WHOLE]
                    best = (least, View(camera, turn, whole, reversed_colours))
    return best[1]


_WHOLE = 4
"""Index of the span that leaves nothing out, see :func:`_views`: the last that begins at 0."""


def picture_sheet(inputs: Mapping[str, NDArray[Any]]) -> Image:
    """Return the images among a model's inputs, side by side with their names, each 256 pixels high."""
    from PIL import Image as pillow
    from PIL import ImageDraw

    images = [(name, image) for name, array in inputs.items() if (image := as_image(array)) is not None]
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


def _orientation(name: str, values: NDArray[Any], observation: Observation) -> StateInput | None:
    """Return the form in which a state has the orientation of the hand; None where it has no known one."""
    q = observation["robot0_eef_quat"]
    sound = {
        "axis times angle, the sign of the quaternion kept": states.axis_angle(q),
        "a quaternion x, y, z, w": q,
        "two columns of the rotation matrix": states.rotation_6d_columns(q),
        "two rows of the rotation matrix": states.rotation_6d_rows(q),
    }
    for form, vector in sound.items():
        if _contains(values, vector):
            return StateInput(name, f"orientation as {form}", "sound")
    if _contains(values, states.axis_angle_antipodal(q)):
        form = "orientation as axis times angle of at most pi (antipodal rule)"
        return StateInput(name, form, "antipodal")
    if _contains(values, np.roll(q, 1)):
        return StateInput(name, "orientation as a quaternion w, x, y, z", "w_first")
    misread = (
        states.axis_angle(np.roll(q, 1)),
        states.axis_angle_antipodal(np.roll(q, 1)),
        states.axis_angle(np.roll(q, -1)),
    )
    if any(_contains(values, vector) for vector in misread):
        return StateInput(name, "orientation from a quaternion read in the wrong order", "misread")
    return None


def _contains(values: NDArray[Any], vector: NDArray[Any]) -> bool:
    """Return True if a vector stands somewhere among the values."""
    count = len(vector)
    return any(np.allclose(values[i : i + count], vector, atol=1e-4) for i in range(len(values) - count + 1))
