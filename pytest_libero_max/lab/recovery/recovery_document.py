"""A comparison of restoration modes as one typed document: ``libero-max lab recovery`` with ``--json``."""

from __future__ import annotations

from typing import Any

from pytest_libero_max.stats.blocks import (
    Amount,
    Block,
    Count,
    Interval,
    Ratio,
    Text,
    WideDifference,
)


class CommonCases(Block, frozen=True, kw_only=True):
    """Cases that are compared."""

    common: Count
    """Cases that every run has measured."""
    planned: Count
    """Planned cases of the native run."""
    unsupported: dict[str, Count]
    """By mode, number of planned cases that the policy does not support."""


class ActiveShares(Block, frozen=True, kw_only=True):
    """Queries whose images were restored, of all."""

    base: Ratio | None
    """In Base; None where nothing was counted."""
    dynamic: Ratio | None
    """In Dynamic after the event; None where nothing was counted."""


class ImageNotes(Block, frozen=True, kw_only=True):
    """Counts of the wrapper that restores images, by name."""

    base: dict[str, int] | None
    """In Base; None where nothing was counted."""
    dynamic: dict[str, int] | None
    """In Dynamic after the event; None where nothing was counted."""


class Mode(Block, frozen=True, kw_only=True):
    """Results with one mode."""

    base: Ratio
    """Base success rate."""
    dynamic: Ratio
    """Dynamic success rate."""
    active: ActiveShares
    """Queries whose images were restored, of all."""
    images: ImageNotes
    """Counts of the wrapper that restores images."""
    seconds_per_query: Amount | None
    """Time of judging and restoring; None without a count."""


class Gain(Block, frozen=True, kw_only=True):
    """A difference between two modes over the same cases."""

    pairs: Count
    """Cases."""
    gained: Count
    """Cases in which the difference is above 0."""
    lost: Count
    """Cases in which it is below 0."""
    value: WideDifference | None
    """Mean over the cases."""
    configurations: Count
    """Tasks with an initial state, which are resampled whole."""
    changed_configurations: Count
    """Those in which a case differs."""
    lower: WideDifference | None
    """Lower end of the 95% interval for independent cases: the melded exact one, and for a closure that of
    weighted means (Gaffke 2005)."""
    upper: WideDifference | None
    """Upper end of the same."""
    bootstrap: Interval
    """The paper's interval, clustered by configuration, for comparison with it; None at both ends where too
    little could vary."""


class Effect(Gain, frozen=True, kw_only=True):
    """A quantity with one mode less that with another."""

    mode: Text
    """The mode."""
    over: Text
    """The mode that is subtracted."""
    quantity: Text
    """dynamic, base or closure (the Dynamic gain less the Base gain)."""


class Group(Gain, frozen=True, kw_only=True):
    """The gain in Dynamic with a mode, within a group of cases."""

    mode: Text
    """The mode."""
    kind: Text
    """source or corruption."""
    name: Text
    """The group."""
    native: Ratio
    """Dynamic success without restoration."""
    restored: Ratio
    """Dynamic success with the mode."""


class Recovery(Block, frozen=True, kw_only=True):
    """Runs of one policy with and without restoration of its images."""

    policy: dict[str, Any]
    """The spec of the native run."""
    substrate: Text
    """Name of the substrate."""
    case_set: Text
    """Name of the track or manifest."""
    pairs: CommonCases
    """Cases that are compared."""
    replicates: Count
    """Resamples of the bootstrap."""
    modes: dict[str, Mode]
    """Results by mode."""
    effects: list[Effect]
    """Differences between modes."""
    groups: list[Group]
    """Dynamic gains by group."""
