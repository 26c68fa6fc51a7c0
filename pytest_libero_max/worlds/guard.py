"""Find writes to those parts of a compiled model that no change alters.

A world's snapshot, digest and reset cover the model fields that changes alter. Everything else of a model
and its options is fixed when the scene is built; a guard finds a write to it, and puts it back.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import mujoco

COPIED_BYTES = 2**20
"""Fields up to this size are compared with a copy. Of larger ones (textures, meshes) only sums are kept."""

RENDERERS = (
    "vis.global_.offheight",
    "vis.global_.offwidth",
    "vis.map.shadowclip",
    "vis.quality.offsamples",
    "vis.quality.shadowsize",
)
"""Settings that are not guarded: the renderer writes them before it reads them, which it does once."""

_STRUCTS = ("opt", "stat", "vis")
_ROW_WORDS = 1024


class ModelGuard:
    """Remembers the fixed fields of a model, finds writes to them and undoes these."""

    def __init__(self, model: mujoco.MjModel, alterable: Collection[str]) -> None:
        self._model = model
        names = (name for name in dir(model) if not name.startswith("_") and name not in alterable)
        arrays = {name: getattr(model, name) for name in names}
        self._arrays = {name: value for name, value in arrays.items() if _is_filled(value)}
        self._copies = {
            name: array.tobytes() for name, array in self._arrays.items() if array.nbytes <= COPIED_BYTES
        }
        self._sums = {
            name: word_sums(array) for name, array in self._arrays.items() if name not in self._copies
        }
        self._settings = {path: _value(owner, name) for path, owner, name in settings_of(model)}
        self._spoiled: set[str] = set()

    @property
    def spoiled(self) -> bool:
        """True if a field was written that cannot be put back: the scene has to be built anew."""
        return bool(self._spoiled)

    def take_back(self) -> tuple[str, ...]:
        """Find every write to a fixed field since the last call, and undo it.

        A field that is larger than :data:`COPIED_BYTES` stays as it was written, and the guard is
        :attr:`spoiled` from then on.

        Returns:
            The fields that had been written, for example ``opt.gravity``, sorted.
        """
        written = []
        for name, copy in self._copies.items():
            array = self._arrays[name]
            if array.tobytes() != copy:
                array[...] = np.frombuffer(copy, array.dtype).reshape(array.shape)
                written.append(name)
        for name, sums in self._sums.items():
            if name not in self._spoiled and word_sums(self._arrays[name]) != sums:
                self._spoiled.add(name)
                written.append(name)
        for path, owner, name in settings_of(self._model):
            former = self._settings[path]
            if _value(owner, name) != former:
                if isinstance(former, bytes):
                    array = getattr(owner, name)
                    array[...] = np.frombuffer(former, array.dtype).reshape(array.shape)
                else:
                    setattr(owner, name, former)
                written.append(path)
        return tuple(sorted(written))


def settings_of(model: mujoco.MjModel) -> Iterator[tuple[str, Any, str]]:
    """Yield path, owner and name of each option, statistic and visual setting of a model.

    The settings in :data:`RENDERERS` are left out.
    """
    for struct in _STRUCTS:
        for leaf in _leaves_of(getattr(model, struct), struct):
            if leaf[0] not in RENDERERS:
                yield leaf


def _leaves_of(owner: Any, path: str) -> Iterator[tuple[str, Any, str]]:
    for name in dir(owner):
        if name.startswith("_"):
            continue
        value = getattr(owner, name)
        if isinstance(value, np.ndarray | int | float):
            yield f"{path}.{name}", owner, name
        elif type(value).__module__.startswith("mujoco"):
            yield from _leaves_of(value, f"{path}.{name}")


def _value(owner: Any, name: str) -> Any:
    """Return a number as it is, an array as its bytes."""
    value = getattr(owner, name)
    return value.tobytes() if isinstance(value, np.ndarray) else value


def _is_filled(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.size > 0


def word_sums(array: NDArray[Any]) -> tuple[bytes, ...]:
    """Return sums of the rows and columns of an array's 64-bit words; another value or order changes them."""
    content = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    whole = content.size // (8 * _ROW_WORDS) * 8 * _ROW_WORDS
    words = content[:whole].view(np.uint64).reshape(-1, _ROW_WORDS)
    rows, columns = np.add.reduce(words, axis=1), np.add.reduce(words, axis=0)
    return rows.tobytes(), columns.tobytes(), content[whole:].tobytes()
