"""The names by which profiles call the transforms."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import signature
from types import MappingProxyType
from typing import Any

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.policies.transforms import actions, images, states


def _replace(text: str, change: list[str]) -> str:
    old, new = change
    return text.replace(old, new)


def _named(*functions: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    return {function.__name__: function for function in functions}


INPUT_STEPS: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {
        **_named(images.rotate_180, images.flip_rows, images.resize_with_pad, images.resize_bilinear),
        **_named(images.resize_bicubic, images.resize_lanczos, images.resize_area, images.centre_crop),
        **_named(images.jpeg_round_trip, images.png_file),
        "base64": lambda content: base64.b64encode(content).decode("ascii"),
        **_named(images.to_unit, images.to_signed, images.channels_first),
        **_named(states.axis_angle, states.axis_angle_antipodal, states.rotation_6d_columns),
        **_named(states.rotation_6d_rows, states.grip_site_quaternion, states.sine_cosine),
        **_named(states.pad_to, states.first, states.entry),
    }
)
"""Transforms of an observation."""

TEXT_STEPS: Mapping[str, Callable[..., str]] = MappingProxyType(
    {
        "lower": str.lower,
        "capitalise": str.capitalize,
        "replace": _replace,
        "template": lambda text, template: template.replace("{instruction}", text),
    }
)
"""Transforms of an instruction."""

ACTION_STEPS: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {
        **_named(actions.first_columns, actions.clip, actions.gripper_from_opening),
        **_named(actions.gripper_from_open_flag, actions.gripper_from_close_flag, actions.gripper_sign),
        **_named(actions.gripper_inverted, actions.gripper_flag_below_half, actions.pose_from_rotation_6d),
    }
)
"""Transforms of the actions of a reply."""

NEEDS_ARGUMENT = frozenset(
    name
    for known in (INPUT_STEPS, TEXT_STEPS, ACTION_STEPS)
    for name, piece in known.items()
    if len(signature(piece).parameters) > 1
)
"""The steps that are written with a value: ``{ resize_area = 224 }``."""


@dataclass(frozen=True)
class Step:
    """One piece with its argument."""

    name: str
    apply: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    """None or one."""

    def __call__(self, value: Any) -> Any:
        """Apply it."""
        try:
            return self.apply(value, *self.arguments)
        except AdapterError as error:
            raise error.within(f"step {self.name!r}") from None
        except (TypeError, ValueError, IndexError, AttributeError) as error:
            shape = getattr(value, "shape", "")
            raise AdapterError(
                f"step {self.name!r} cannot be applied to {type(value).__name__} {shape}: {error}. "
                "Check the order of the steps."
            ) from error


def parse_steps(values: Any, known: Mapping[str, Callable[..., Any]], where: str) -> tuple[Step, ...]:
    """Read the steps of a profile: names, or tables of one name and its argument."""
    if not isinstance(values, list):
        raise AdapterError.seen(
            where, values, f", but must be a list of steps. Known: {', '.join(sorted(known))}."
        )
    return tuple(_step(value, known, where) for value in values)


def _step(value: Any, known: Mapping[str, Callable[..., Any]], where: str) -> Step:
    if isinstance(value, dict) and len(value) == 1:
        ((name, argument),) = value.items()
        arguments: tuple[Any, ...] = (argument,)
    else:
        name, arguments = value, ()
    if not isinstance(name, str) or name not in known:
        raise AdapterError(f"{where}: {value!r} is no step. {did_you_mean(str(name), known)}")
    if bool(arguments) != (name in NEEDS_ARGUMENT):
        form = f"{{ {name} = ... }}" if name in NEEDS_ARGUMENT else repr(name)
        raise AdapterError(f"{where}: {value!r}, but this step is written {form}.")
    return Step(name, known[name], arguments)
