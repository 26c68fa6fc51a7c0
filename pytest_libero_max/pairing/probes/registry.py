"""The probes that can be asked for by name: a module of this folder each, and those of other packages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry, class_in, classes_in

if TYPE_CHECKING:
    from pytest_libero_max.pairing.probes.probe import Column, Probe, Probes

_MODULES = "pytest_libero_max.pairing.probes"
_BASE = "pytest_libero_max.pairing.probes.probe:Probe"
_OWN = classes_in(_MODULES, _BASE, skip=("monitor", "probe", "registry", "standard", "stages"))


def own_schema(name: str) -> tuple[Column, ...] | None:
    """Return the columns of a probe of this package; None of any other, which is not imported."""
    if name != "stages":
        return PROBES[name].schema if PROBES.is_ours(name) else None
    schema: tuple[Column, ...] = class_in(f"{_MODULES}.{name}", _BASE).schema
    return schema


def _accept(name: str, value: object) -> Probe[Any]:
    from pytest_libero_max.pairing.probes.probe import check_probe
    from pytest_libero_max.pairing.probes.standard import STANDARD

    if name in {probe.name for probe in STANDARD.standard}:
        raise ValueError("a probe of every pair has that name")
    return check_probe(name, value)


PROBES: Registry[Probe[Any]] = Registry("probe", "pytest_libero_max.probes", _OWN, _accept, OptionError)
"""Every probe that can be asked for, by name."""


def probes_called(names: Iterable[str]) -> Probes:
    """Return the probes of every pair, and those with these names, each once, or raise OptionError."""
    from dataclasses import replace

    from pytest_libero_max.pairing.probes.standard import STANDARD

    return replace(STANDARD, added=tuple(PROBES[name] for name in dict.fromkeys(names)))
