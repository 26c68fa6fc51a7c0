"""A comparison of restoration modes as one typed document: ``libero-max lab recovery`` with ``--json``."""

from __future__ import annotations

from typing import Any

from pytest_libero_max.report.blocks import (
    Amount,
    Block,
    Count,
    Interval,
    Ratio,
    Text,
    WideDifference,
)


class CommonCases(Block, frozen=True, kw_only=True):
    """Cases that are compared.

    Attributes:
        common: Cases that every run has measured.
        planned: Planned cases of the native run.
        unsupported: By mode, number of planned cases that the policy does not support.
    """

    common: Count
    planned: Count
    unsupported: dict[str, Count]


class ActiveShares(Block, frozen=True, kw_only=True):
    """Queries whose images were restored, of all.

    Attributes:
        base: In Base; None where nothing was counted.
        dynamic: In Dynamic after the event; None where nothing was counted.
    """

    base: Ratio | None
    dynamic: Ratio | None


class ImageNotes(Block, frozen=True, kw_only=True):
    """Counts of the wrapper that restores images, by name.

    Attributes:
        base: In Base; None where nothing was counted.
        dynamic: In Dynamic after the event; None where nothing was counted.
    """

    base: dict[str, int] | None
    dynamic: dict[str, int] | None


class Mode(Block, frozen=True, kw_only=True):
    """Results with one mode.

    Attributes:
        base: Base success rate.
        dynamic: Dynamic success rate.
        active: Queries whose images were restored, of all.
        images: Counts of the wrapper that restores images.
        seconds_per_query: Time of judging and restoring; None without a count.
    """

    base: Ratio
    dynamic: Ratio
    active: ActiveShares
    images: ImageNotes
    seconds_per_query: Amount | None


class Gain(Block, frozen=True, kw_only=True):
    """A difference between two modes over the same cases.

    Attributes:
        pairs: Cases.
        gained: Cases in which the difference is above 0.
        lost: Cases in which it is below 0.
        value: Mean over the cases.
        configurations: Tasks with an initial state, which are resampled whole.
        changed_configurations: Those in which a case differs.
        lower: Lower end of the 95% interval for independent cases: the melded exact one, and for a closure
            that of weighted means (Gaffke 2005).
        upper: Upper end of the same.
        bootstrap: The paper's interval, clustered by configuration, for comparison with it; None at both ends
            where too little could vary.
    """

    pairs: Count
    gained: Count
    lost: Count
    value: WideDifference | None
    configurations: Count
    changed_configurations: Count
    lower: WideDifference | None
    upper: WideDifference | None
    bootstrap: Interval


class Effect(Gain, frozen=True, kw_only=True):
    """A quantity with one mode less that with another.

    Attributes:
        mode: The mode.
        over: The mode that is subtracted.
        quantity: dynamic, base or closure (the Dynamic gain less the Base gain).
    """

    mode: Text
    over: Text
    quantity: Text


class Group(Gain, frozen=True, kw_only=True):
    """The gain in Dynamic with a mode, within a group of cases.

    Attributes:
        mode: The mode.
        kind: source or corruption.
        name: The group.
        native: Dynamic success without restoration.
        restored: Dynamic success with the mode.
    """

    mode: Text
    kind: Text
    name: Text
    native: Ratio
    restored: Ratio


class Recovery(Block, frozen=True, kw_only=True):
    """Runs of one policy with and without restoration of its images.

    Attributes:
        policy: The spec of the native run.
        substrate: Name of the substrate.
        case_set: Name of the track or manifest.
        pairs: Cases that are compared.
        replicates: Resamples of the bootstrap.
        modes: Results by mode.
        effects: Differences between modes.
        groups: Dynamic gains by group.
    """

    policy: dict[str, Any]
    substrate: Text
    case_set: Text
    pairs: CommonCases
    replicates: Count
    modes: dict[str, Mode]
    effects: list[Effect]
    groups: list[Group]
