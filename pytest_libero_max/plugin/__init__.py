"""The pytest plugin: options, collection, fixtures, transport of results, terminal. Thin.

pytest loads :mod:`pytest_libero_max.plugin.hooks` in every session of everybody who has the package
installed, so nothing here imports a simulator, NumPy or a policy before a pair asks for one. Where plugins
are not loaded by themselves (``PYTEST_DISABLE_PLUGIN_AUTOLOAD``), ``-p libero_max`` loads it, and so does
this package, ``-p pytest_libero_max.plugin``, which registers the same under the same name.

The modules of the package are imported as they are written. pytest would rewrite the ``assert`` statements
of all 300 that a run imports, as it does for every plugin; a process that cannot write bytecode would do so
every time. The word PYTEST_DONT_REWRITE says so to pytest as well, which otherwise warns of a plugin that was
imported before.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

PLUGIN_NAME = "libero_max"
"""Name of the entry point, under which pytest knows the plugin."""


class _AsWritten(MetaPathFinder):
    """Finds the modules of this package before pytest's import hook does."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        ours = fullname.startswith("pytest_libero_max.")
        return PathFinder.find_spec(fullname, path, target) if ours else None


sys.meta_path.insert(0, _AsWritten())


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Register the hooks where this package itself is named as a plugin."""
    from pytest_libero_max.plugin import hooks

    if not pluginmanager.has_plugin(PLUGIN_NAME):
        pluginmanager.register(hooks, PLUGIN_NAME)
