"""Case support: the default track of a substrate, and the cases of a track that it can play.

Decided from files alone, before anything is built. A run whose pairs the user names (``-k``, ``-m``, ids)
is not refused: a case that cannot play is then an error of its own pair.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING

from pytest_libero_max.errors import LiberoMaxError, OptionError, counted

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.substrates.contract import SubstrateOptions


def supported_track(name: str | None, substrate: str, options: SubstrateOptions) -> str:
    """Return the name of the track to play.

    Args:
        name: Track that was asked for; None for the first default of the substrate of which every case plays.
    """
    from pytest_libero_max.substrates.registry import SUBSTRATES

    tracks = SUBSTRATES[substrate].tracks(options)
    if name is not None:
        return tracks.name(name)
    *preferred, last = map(tracks.name, tracks.defaults)
    return next((track for track in preferred if _all_supported(track, substrate, options)), last)


def require_support(case_set: str, cases: Sequence[Case], substrate: str, options: SubstrateOptions) -> None:
    """Refuse cases that cannot play on the substrate: raises OptionError or SubstrateError."""
    from pytest_libero_max.substrates.registry import SUBSTRATES

    found = SUBSTRATES[substrate].unplayable(options, cases)
    if not found:
        return
    others = len(cases) - len(found)
    leave_out = f"add --libero-max-only-installed to play the other {others}, or " if others else ""
    raise OptionError(
        f"{_refusal(case_set, cases, substrate, options, found)}; {leave_out}choose the pairs yourself with "
        "-k or -m."
    )


def supported_cases(
    case_set: str, cases: Sequence[Case], substrate: str, options: SubstrateOptions
) -> tuple[Case, ...]:
    """Return the cases that can play on the substrate, in their order; arguments as `require_support`.

    Raises:
        OptionError: There is none.
        SubstrateError: A genuine installation is missing.
    """
    from pytest_libero_max.substrates.registry import SUBSTRATES

    found = SUBSTRATES[substrate].unplayable(options, cases)
    fit = tuple(case for case in cases if case.case_id not in found)
    if not fit:
        raise OptionError(f"{_refusal(case_set, cases, substrate, options, found)}.")
    return fit


def _refusal(
    case_set: str,
    cases: Sequence[Case],
    substrate: str,
    options: SubstrateOptions,
    found: Mapping[str, str],
) -> str:
    """Return the message: the cases that cannot be played by reason, and the tracks that fit."""
    several = [f"{number}: {reason}." for reason, number in Counter(found.values()).most_common()]
    fits = " or ".join(f"--libero-max-track={name}" for name in _supported_tracks(substrate, options))
    return (
        f"{len(found)} of {counted(len(cases), 'case')} of {case_set} cannot be played on substrate "
        f"{substrate}.\n" + "\n".join(several) + (f"\nPlay {fits}, which fits" if fits else "\nNo track fits")
    )


def _supported_tracks(substrate: str, options: SubstrateOptions) -> list[str]:
    """Return the tracks of which every case may play, as they are asked for.

    All of a substrate that has tracks of its own; else the first, the defaults before others.
    """
    from pytest_libero_max.benchmark.tracks import FOLDER, track_names
    from pytest_libero_max.substrates.registry import SUBSTRATES

    tracks = SUBSTRATES[substrate].tracks(options)
    own, defaults = track_names(FOLDER / tracks.folder), tracks.defaults
    names = dict.fromkeys((*own, *defaults) if tracks.folder else (*defaults, *own))
    fit = (name for name in names if _all_supported(tracks.name(name), substrate, options))
    return list(fit) if tracks.folder else list(islice(fit, 1))


def _all_supported(name: str, substrate: str, options: SubstrateOptions) -> bool:
    from pytest_libero_max.benchmark.tracks import load_track
    from pytest_libero_max.substrates.registry import SUBSTRATES

    try:
        return not SUBSTRATES[substrate].unplayable(options, load_track(name).cases)
    except LiberoMaxError:  # no LIBERO is installed, which is said elsewhere
        return False
