"""Digests of a scene, field by field, over compiled and decided values and not over the code that made them.

A field is one thing with a value: an array of the compiled model, a setting of its options, the goal, a gain
of the controller. Equal values have equal digests, whatever module, class or version of this package made
them, and the fields that differ say what was played differently.

Values count bit for bit. What MuJoCo compiles (inertias, normals, trees of bounding boxes) and where objects
come to rest therefore depends on the version of MuJoCo, and may differ in the last bits between kinds of
processors. The folders of mesh and texture files do not count, nor sums of memory that contain them, nor
settings that only a renderer writes and reads.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.worlds.contract import WorldState
from pytest_libero_max.worlds.guard import COPIED_BYTES, settings_of, word_sums

if TYPE_CHECKING:
    import mujoco

_OF_A_MACHINE = frozenset({"nbuffer", "npaths", "paths", "signature"})
"""Fields of a model that depend on where files lie, or follow from the others."""


def combined(fields: Mapping[str, str]) -> str:
    """SHA-256 over fields and their digests in the order of their names, hexadecimal."""
    return hashlib.sha256(json.dumps(sorted(fields.items())).encode()).hexdigest()


def value_digest(value: Any) -> str:
    """SHA-256 of a value, hexadecimal.

    Args:
        value: An array, by dtype, shape and content; bytes; or JSON values, tuples among them. Of an array
            of more than :data:`~.guard.COPIED_BYTES` (textures, meshes) the sums of its words count.
    """
    if isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        head = f"{array.dtype.str}{value.shape}".encode()
        if array.nbytes > COPIED_BYTES:
            return hashlib.sha256(b"".join((head, *word_sums(array)))).hexdigest()
        return hashlib.sha256(head + array.tobytes()).hexdigest()
    content = value if isinstance(value, bytes) else json.dumps(value).encode()
    return hashlib.sha256(content).hexdigest()


def model_fields(model: mujoco.MjModel, compiled: Mapping[str, NDArray[Any]]) -> dict[str, str]:
    """Digest of every field of a compiled model: sizes, arrays, names, options, statistics, visual settings.

    Args:
        compiled: Values as they were compiled, for arrays that may have been changed since.
    """
    fields = {}
    for name in sorted({name for name in dir(model) if not name.startswith("_")} - _OF_A_MACHINE):
        value = compiled.get(name, getattr(model, name))
        if isinstance(value, np.ndarray | int | bytes) and not name.endswith("_pathadr"):
            fields[f"model.{name}"] = value_digest(value)
    for path, owner, name in settings_of(model):
        fields[f"model.{path}"] = value_digest(getattr(owner, name))
    return fields


def state_fields(state: WorldState) -> dict[str, str]:
    """Digest of each part of a snapshot: physics, alterable model fields, controller, filters."""
    rest = {
        "steps": state.steps,
        "filters": [[repr(filter), since] for filter, since in state.filters],
        "parked": state.parked,
        "assigned": state.assigned,
        "control": state.control,
    }
    arrays = {f"start.model.{name}": array for name, array in state.model.items()}
    arrays |= {"start.physics": state.physics, "start.controller": state.controller}
    values: Mapping[str, Any] = {**arrays, **{f"start.{name}": value for name, value in rest.items()}}
    return {name: value_digest(value) for name, value in values.items()}
