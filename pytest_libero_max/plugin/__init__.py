"""The pytest plugin: options, collection, fixtures, transport of results, terminal. Thin.

pytest loads :mod:`pytest_libero_max.plugin.hooks` in every session of everybody who has the package
installed, so nothing here imports a simulator, NumPy or a policy before a pair asks for one.

The modules of the package are imported as they are written. pytest would rewrite the ``assert`` statements
of all 300 that a run imports, as it does for every plugin; a process that cannot write bytecode would do so
every time.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType


class _AsWritten(MetaPathFinder):
    """Finds the modules of this package before pytest's import hook does."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        ours = fullname.startswith("pytest_libero_max.")
        return PathFinder.find_spec(fullname, path, target) if ours else None


sys.meta_path.insert(0, _AsWritten())
