"""The probes that can be asked for by name: a module of this folder each, and those of other packages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry, class_in, modules_in

if TYPE_CHECKING:
    from pytest_libero_max.pairing.probes.probe import Column, Probe, Probes

_MODULES = "pytest_libero_max.pairing.probes"
_NOT_ASKED_FOR = ("monitor", "probe", "registry", "standard", "stages")


def _own() -> Mapping[str, Callable[[], Probe[Any]]]:
    return {name: partial(_load, name) for name in modules_in(_MODULES) if name not in _NOT_ASKED_FOR}


def _load(name: str) -> Probe[Any]:
    return _accept(name, _class_in(name))


def _class_in(name: str) -> type[Probe[Any]]:
    """Return the probe of a module of this folder."""
    from pytest_libero_max.pairing.probes.probe import Probe

    kind: type[Probe[Any]] = class_in(f"{_MODULES}.{name}", Probe)
    return kind


def own_schema(name: str) -> tuple[Column, ...] | None:
    """Return the columns of a probe of this package; None of any other, which is not imported."""
    if name == "stages":
        return _class_in(name).schema
    return PROBES[name].schema if PROBES.is_ours(name) else None


def _accept(name: str, value: object) -> Probe[Any]:
    from pytest_libero_max.pairing.probes.probe import check_probe
    from pytest_libero_max.pairing.probes.standard import STANDARD

    if name in {probe.name for probe in STANDARD.standard}:
        raise ValueError("a probe of every pair has that name")
    return check_probe(name, value)


PROBES: Registry[Probe[Any]] = Registry("probe", "pytest_libero_max.probes", _own, _accept, OptionError)
"""Every probe that can be asked for, by name."""


def probes_called(names: Iterable[str]) -> Probes:
    """Return the probes of every pair, and those with these names, each once.

    Raises:
        OptionError: There is no such probe, or it cannot be loaded.
    """
    from dataclasses import replace

    from pytest_libero_max.pairing.probes.standard import STANDARD

    return replace(STANDARD, added=tuple(PROBES[name] for name in dict.fromkeys(names)))
