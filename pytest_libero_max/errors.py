"""Every exception this package raises on purpose.

A message names what was seen, the rule, and what to do next. The attributes of an error hold the same data::

    raise OptionError.seen("limit", limit, ", but must be at least 1.")
    raise ManifestError(f"{path} is damaged. Restore it.", path=path)
"""

from __future__ import annotations

import difflib
import pickle
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Self

__all__ = [
    "ActionError",
    "AdapterError",
    "ChangeError",
    "CrashError",
    "DiskError",
    "EntityError",
    "LiberoMaxError",
    "LimitReached",
    "ManifestError",
    "MemoryLimitError",
    "OptionError",
    "OtherRunError",
    "ProbeError",
    "ProtocolError",
    "RefusalError",
    "ReportError",
    "ServerError",
    "SimulatorError",
    "SubstrateError",
    "TimeLimitError",
]

MOST_NAMED = 24
"""Number of known words up to which all are listed."""

CLOSEST = 4
"""Number of words that are named where there are more."""


class LiberoMaxError(Exception):
    """Root of the family. None of these is ever a failure of the policy under test.

    An error can be pickled; a ``value`` that cannot arrives as its ``repr``.

    Args:
        text: The message, complete without the attributes.
        field: See the attribute; the others likewise.

    Attributes:
        field: Name of the field or option at fault, in the spelling of its file: ``protocol.arms``,
            ``--libero-max-shard``. None where no single one is at fault.
        value: Value that was seen there.
        path: The file, None where there is none.
        line: Number of the line in the file, from 1.
    """

    def __init__(
        self,
        text: str = "",
        *,
        field: str | None = None,
        value: Any = None,
        path: Path | str | None = None,
        line: int | None = None,
    ) -> None:
        super().__init__(text)
        self.field = field
        self.value = value
        self.path = None if path is None else Path(path)
        self.line = line

    @classmethod
    def seen(cls, field: str, value: Any, rest: str) -> Self:
        """Return the error about the value of a field: its text is ``FIELD=VALUE`` and the rest.

        Args:
            field: Name of the field; a place before a colon, ``case 'x': draw_id``, is for the text alone.
            value: Value that was seen.
            rest: The rule and what to do next, with the punctuation before it: ``", but must be text."``
        """
        return cls(f"{field}={value!r}{rest}", field=field.rpartition(": ")[2], value=value)

    def within(
        self, where: str, *, field: str | None = None, path: Path | str | None = None, line: int | None = None
    ) -> Self:
        """Return this error with a place in front of its text: ``raise error.within(...) from error``.

        Args:
            where: The place in words, for example ``cases.json, line 3``.
            field: Replaces None; a field that is known already is kept. ``path`` and ``line`` likewise.
            path: The file.
            line: Number of the line in the file, from 1.
        """
        return type(self)(
            f"{where}: {self}",
            field=self.field or field,
            value=self.value,
            path=self.path or path,
            line=self.line or line,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        state = dict(self.__dict__)
        try:
            pickle.dumps(self.value)
        except Exception:  # a value of a user's adapter may fail in any way
            state["value"] = repr(self.value)
        return (type(self), self.args, state)


class OptionError(LiberoMaxError):
    """A command-line or ini option has a value that cannot be used."""


class ManifestError(LiberoMaxError):
    """A manifest is unreadable, incomplete or contradicts itself."""


class AdapterError(LiberoMaxError):
    """A policy adapter cannot be loaded or breaks the Policy contract."""


class RefusalError(AdapterError):
    """A policy did what no measured policy may do: it answers differently when it is asked again, or writes.

    A pair that is refused stays refused, however often it is played: a later play that happens to pass is no
    measurement. All other errors are faults, after which a pair may be played again.
    """


class ActionError(RefusalError):
    """A policy returned actions of the wrong shape, or actions that are not finite."""


class ServerError(LiberoMaxError):
    """A policy server cannot be reached, reports an error, or answers what cannot be read."""


class ChangeError(LiberoMaxError):
    """A change is malformed or cannot be applied to this world."""


class SubstrateError(LiberoMaxError):
    """A substrate cannot build or restore a scene."""


class EntityError(SubstrateError):
    """A world has no entity of that name."""


class SimulatorError(LiberoMaxError):
    """The simulation itself broke: a state that is not finite, a renderer that does not answer."""


class CrashError(LiberoMaxError):
    """The process that played a pair died: a signal, a crash in native code, an exit of the adapter."""


class TimeLimitError(LiberoMaxError):
    """A query, a step or a pair took longer on the wall clock than it may. No step budget is meant."""


class LimitReached(BaseException):
    """Ends an activity that takes too long; not an ``Exception``, so that no handler there stops it.

    It becomes a :class:`TimeLimitError` of the pair.
    """


class MemoryLimitError(LiberoMaxError):
    """A process wanted more memory than it may use."""


class ProtocolError(LiberoMaxError):
    """A pair is not a valid measurement: the prefixes differ, or the event fired twice."""


class ProbeError(LiberoMaxError):
    """A probe raised, wrote to the world, or yields something else than it declares."""


class ReportError(LiberoMaxError):
    """Results cannot be read, written or aggregated."""


class DiskError(ReportError):
    """A result cannot be written: the disk is full, or the folder is gone or protected."""


class OtherRunError(ReportError):
    """A result is of another run than the one it would belong to: something differs that changes results."""


def is_refusal(kind: str) -> bool:
    """Return True if the name of an exception class is that of a :class:`RefusalError`."""
    known = globals().get(kind)
    return isinstance(known, type) and issubclass(known, RefusalError)


def class_name(value: object) -> str:
    """Return the name of an object's class, also of one whose metaclass has a ``__name__`` of its own."""
    return str(type.__dict__["__name__"].__get__(type(value)))


def text_of(error: BaseException) -> str:
    """Return the text of an exception, also of one that raises when it is asked for."""
    try:
        return str(error)
    except Exception:  # a foreign exception may raise anything
        return "its text cannot be read, because its __str__ raises"


def install_extra(name: str) -> str:
    """Return how an extra of this package is installed, for a message: the package is on no index."""
    return f"`pip install -e '.[{name}]'` in the clone of pytest-libero-max"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a sentence or two with the closest known word and, where they are few, all the others.

    Returns:
        All known words where there are no more than ``MOST_NAMED``; otherwise the closest of them and their
        number. Empty where none is known.
    """
    valid = sorted(known)
    if not valid:
        return ""
    few = len(valid) <= MOST_NAMED
    name = str(name)
    # 2 * (characters in common) / (characters in all) of at least 0.5 cannot be reached by a longer one.
    close = (
        []
        if len(name) > 3 * max(map(len, valid))
        else difflib.get_close_matches(name, valid, n=1 if few else CLOSEST, cutoff=0.5)
    )
    hint = f"Did you mean {close[0]!r}? " if close else ""
    if few:
        return f"{hint}Known: {', '.join(valid)}."
    if close[1:]:
        return f"{hint}Also close: {', '.join(close[1:])}. There are {len(valid)} in all."
    return f"{hint}There are {len(valid)} in all, for example {', '.join(valid[:CLOSEST])}."


def counted(count: float, noun: str, plural: str = "") -> str:
    """Return a number with its noun, for example ``1 run`` and ``2 runs``."""
    number = f"{count:g}" if isinstance(count, float) else count
    return f"{number} {noun if count == 1 else plural or f'{noun}s'}"
