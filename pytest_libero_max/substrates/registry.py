"""The substrates: the folders of this package, and those that other packages add."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.benchmark.text_values import known_in, named_values
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.registry import Registry, modules_in, references
from pytest_libero_max.substrates.contract import (
    Catalogue,
    ChosenSubstrate,
    Substrate,
    SubstrateKind,
    SubstrateOptions,
)

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.substrates.variation import Variation
    from pytest_libero_max.tasks.contents import TaskMetadata

DEFAULT = "embedded"
"""The substrate that is used unless another is asked for. The source variations of its catalogue are this
package's own; libero plays them with ``variations=own``."""

_SUBSTRATES = "pytest_libero_max.substrates"


def _folders() -> dict[str, str]:
    folders = (name for name in modules_in(_SUBSTRATES) if "kind" in modules_in(f"{_SUBSTRATES}.{name}"))
    return {name: f"{name}.kind:KIND" for name in folders}


def _accept(name: str, value: object) -> SubstrateKind:
    if not isinstance(value, SubstrateKind):
        raise ValueError(f"{name} is {value!r}, but must be a SubstrateKind")
    return value


SUBSTRATES: Registry[SubstrateKind] = Registry(
    "substrate",
    "pytest_libero_max.substrates",
    references(_SUBSTRATES, _folders),
    _accept,
    SubstrateError,
    attribute="name",
)
"""Every substrate by name. A folder of this package is one if it has a module ``kind`` with a ``KIND``."""


def chosen_substrate(text: str) -> ChosenSubstrate:
    """Parse the name of a substrate, with options behind a colon: ``libero:semantics=corrected``.

    Raises:
        ValueError: There is no such substrate, or it has no such option or value.
    """
    name, colon, words = text.partition(":")
    known_in(SUBSTRATES)(name)
    if not colon:
        return ChosenSubstrate(name)
    choices = SubstrateOptions.CHOICES.items()
    parsers = {option: known_in(values) for option, values in choices if option in SUBSTRATES[name].reads}
    if not parsers:
        readers = [kind.name for kind in SUBSTRATES.values() if kind.reads & {*SubstrateOptions.CHOICES}]
        raise ValueError(f"the {name} substrate takes no options, but {' and '.join(readers)} does")
    return ChosenSubstrate(name, SubstrateOptions(**named_values(words, "=", parsers)))


def described_substrate(description: Mapping[str, Any]) -> ChosenSubstrate:
    """Return the substrate that the provenance of a run describes, with its options.

    Args:
        description: Its ``substrate``; of a substrate that is not installed here only what it says counts.
    """
    name = description["name"]
    reads = SUBSTRATES[name].reads if name in SUBSTRATES else frozenset[str]()
    values = {
        option: description.get(described)
        or (SubstrateOptions.UNDESCRIBED.get(option) if option in reads else None)
        for option, described in SubstrateOptions.DESCRIBED.items()
    }
    chosen: dict[str, Any] = {option: value for option, value in values.items() if value is not None}
    return ChosenSubstrate(name, SubstrateOptions(**chosen))


def images_of(description: Mapping[str, Any]) -> str | None:
    """Return the version of the images of a described substrate; None where it has one version."""
    chosen = described_substrate(description)
    versions = chosen.name in SUBSTRATES and "images" in SUBSTRATES[chosen.name].reads
    return chosen.options.images if versions else None


def open_substrate(name: str, options: SubstrateOptions | None = None) -> Substrate:
    """Open the substrate called ``name``.

    Args:
        name: One of :data:`SUBSTRATES`.
        options: The options that it is given; by default, none.

    Raises:
        SubstrateError: There is none of that name, or it cannot be opened.
    """
    return SUBSTRATES[name].open(options or SubstrateOptions())


def scores_of(name: str) -> dict[str, Any]:
    """Return the standing of a substrate's scores, as a run records it.

    Args:
        name: Name of a substrate. One that is not installed here is taken for an unknown one.
    """
    kind = SUBSTRATES[name] if name in SUBSTRATES else None  # noqa: SIM401 - it has no `get`
    if kind is None or kind.note is None:
        return {
            "comparable_with_published": False,
            "note": f"Measured on the {name} substrate: a dry run, not a score.",
        }
    return {"comparable_with_published": kind.comparable_with_published, "note": kind.note or None}


def contents_of(suite: str, task_index: int) -> TaskMetadata:
    """Return the contents of an unmodified task, from the first substrate that has its suite.

    Raises:
        ManifestError: There is no such suite.
        SubstrateError: No substrate has it, or it has no such task.
    """
    SUITES[suite]  # refuses an unknown one, with the closest names
    for kind in SUBSTRATES.values():
        if kind.suites is not None and suite in kind.suites:
            return kind.contents(suite, task_index)
    raise SubstrateError.seen("suite", suite, " is of no substrate that is installed here.")


def own_catalogue() -> Catalogue:
    """Return the catalogue of this package's own source variations."""
    return SUBSTRATES[DEFAULT].catalogue(SubstrateOptions())


def own_variation(case: Case) -> Variation:
    """Return the source variation of this package's own that a case of LIBERO-Plus or LIBERO-PRO plays.

    Raises:
        SubstrateError: The case names none of them: it belongs to the genuine LIBERO-Plus or LIBERO-PRO.
    """
    return SUBSTRATES[DEFAULT].variation_of(case)


def describe_substrate(name: str, options: SubstrateOptions | None = None) -> dict[str, Any]:
    """Name and origin of a substrate, as JSON values, without building or importing anything of it.

    Raises:
        SubstrateError: There is none of that name, or a genuine installation is missing or incomplete.
    """
    return {"name": name, **SUBSTRATES[name].describe(options or SubstrateOptions())}
