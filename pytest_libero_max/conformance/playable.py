"""The cases with which a substrate, and policies on it, are examined."""

from __future__ import annotations

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.contract import ChosenSubstrate, SubstrateKind, SubstrateOptions


def playable_cases(chosen: ChosenSubstrate, name: str) -> tuple[Case, ...]:
    """Return the examples of a substrate or, where it has none, the cases of its default track that it plays.

    Raises:
        SubstrateError: No case of its default tracks can be played here.
    """
    from pytest_libero_max.substrates.registry import SUBSTRATES

    kind = SUBSTRATES[chosen.name]
    return tuple(kind.examples(chosen.options)) or _of_tracks(kind, chosen.options, name)


def _of_tracks(kind: SubstrateKind, options: SubstrateOptions, name: str) -> tuple[Case, ...]:
    """Return the cases of the first default track of which some can be played."""
    tracks, reason = kind.tracks(options), ""
    for track in tracks.defaults:
        cases = load_track(tracks.name(track)).cases
        lacking = kind.unplayable(options, cases)
        playable = tuple(case for case in cases if case.case_id not in lacking)
        if playable:
            return playable
        reason = next(iter(lacking.values()))
    raise SubstrateError(
        f"{name} plays no case of {' or '.join(tracks.defaults)}: {reason}. Give a substrate of other suites "
        "cases to be examined with: SubstrateKind(examples=...)."
    )
