"""Every exception this package raises on purpose.

A message names what was seen, the rule, and what to do next.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

MOST_NAMED = 40
"""Up to so many known words are listed in full."""

CLOSEST = 4
"""How many of more words are named."""


class LiberoMaxError(Exception):
    """Root of the family. None of these is ever a failure of the policy under test."""


class OptionError(LiberoMaxError):
    """A command-line or ini option has a value that cannot be used."""


class ManifestError(LiberoMaxError):
    """A manifest is unreadable, incomplete or contradicts itself."""


class AdapterError(LiberoMaxError):
    """A policy adapter cannot be loaded or breaks the Policy contract."""


class ActionError(AdapterError):
    """A policy returned actions of the wrong shape, or actions that are not finite."""


class ServerError(LiberoMaxError):
    """A policy server cannot be reached, reports an error, or answers what cannot be read."""


class ChangeError(LiberoMaxError):
    """A change is malformed or cannot be applied to this world."""


class SubstrateError(LiberoMaxError):
    """A substrate cannot build or restore what was asked for."""


class EntityError(SubstrateError):
    """A world has no entity of that name."""


class SimulatorError(LiberoMaxError):
    """The simulation itself broke: a state that is not finite, a renderer that does not answer."""


class CrashError(LiberoMaxError):
    """The process that played a pair died: a signal, a crash in native code, an exit of the adapter."""


class TimeLimitError(LiberoMaxError):
    """A query, a step or a pair took longer on the wall clock than it may. No step budget is meant."""


class LimitReached(BaseException):
    """Raised in the middle of what takes too long; not an ``Exception``, so that nothing there handles it.

    It becomes a :class:`TimeLimitError` of the pair.
    """


class MemoryLimitError(LiberoMaxError):
    """A process wanted more memory than it may use."""


class ProtocolError(LiberoMaxError):
    """A pair is not a valid measurement: the prefixes differ, or the event fired twice."""


class ReportError(LiberoMaxError):
    """Results cannot be read, written or aggregated."""


class DiskError(ReportError):
    """A result cannot be written: the disk is full, or the folder is gone or protected."""


class OtherRunError(ReportError):
    """A result is of another run than the one it would belong to: something differs that changes results."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A sentence or two that name the closest known word and, as far as they are few, the others.

    Args:
        name: What was written.
        known: Every valid spelling.

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
