"""Entry of the genuine substrate: how it is opened and described."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.contract import (
    Catalogue,
    Substrate,
    SubstrateKind,
    SubstrateOptions,
    Tracks,
)
from pytest_libero_max.tasks.suites import LIBERO_SUITES

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.substrates.libero.installation import Installation


def _open(options: SubstrateOptions) -> Substrate:
    from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
    from pytest_libero_max.substrates.registry import own_variation

    own = own_variation if options.variations == "own" else None
    return LiberoSubstrate(_installations(options), options.semantics, options.instruction, own)


def _describe(options: SubstrateOptions) -> dict[str, Any]:
    return {
        "installations": [str(installation) for installation in _installations(options)],
        "roots": [str(root) for root in options.installations],
        "assets": None if options.assets is None else str(options.assets),
        "semantics": options.semantics,
        "instruction_source": options.instruction,
        "source_variations": options.variations,
    }


def _installations(options: SubstrateOptions) -> tuple[Installation, ...]:
    from pytest_libero_max.substrates.libero.installation import find_installations

    return find_installations(options.installations, assets=options.assets)


def _catalogue(options: SubstrateOptions) -> Catalogue:
    from pytest_libero_max.substrates.libero.installed_catalogue import InstalledCatalogue

    if options.variations == "own":
        raise SubstrateError(
            "Source variations 'own' are chosen on the substrate that they were made for. Leave out "
            "--substrate, or choose from the variations that are installed."
        )
    return InstalledCatalogue(_installations(options), options.classification)


def _lacking(options: SubstrateOptions, cases: Sequence[Case]) -> Mapping[str, str]:
    from pytest_libero_max.substrates.libero.lacking import lacking, lacking_own

    if options.variations == "own":
        return lacking_own(cases)
    return lacking(_installations(options), cases)


def _tracks(options: SubstrateOptions) -> Tracks:
    from pytest_libero_max.benchmark.tracks import GENUINE

    if options.variations == "own":
        return Tracks()
    return Tracks(GENUINE, ("smoke", "original"), f"{GENUINE}/smoke")


def _scene_of(options: SubstrateOptions, case: Case) -> tuple[Any, ...]:
    """Key of a scene: textures and meshes are those of the task that is varied, unless it brings others."""
    from pytest_libero_max.substrates.libero.plus import base_name
    from pytest_libero_max.substrates.registry import own_variation

    task = f"{case.task_index:02d}"
    if options.variations == "own" and case.source != "libero":
        task = f"{own_variation(case).base_index:02d}"
    elif case.source == "plus" and "task_name" in case.record:
        task = base_name(case.record["task_name"])
    return case.suite, case.source, task, case.source_category or ""


KIND = SubstrateKind(
    "libero",
    _open,
    _describe,
    _lacking,
    _catalogue,
    suites=LIBERO_SUITES,
    tracks=_tracks,
    reads=frozenset({"installations", "assets", "semantics", "instruction", "variations"}),
    comparable_with_published=None,
    note="",
    worker_gib=3.1,  # the most that one had after any of 66 pairs
    limit_gib=10.0,  # each scene asks three times for 1.2 GiB and uses little of it
    scene_of=_scene_of,
    batch=1,  # a case takes seconds, which are not lost
)
