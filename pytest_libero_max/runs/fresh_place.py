"""A place in which a process finds nothing that an earlier one has left on the disk."""

from __future__ import annotations

import os
import site
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from pytest_libero_max.machine import weight_folders

_OF_A_USER = ("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME")
_TEMPORARY = ("TMPDIR", "TEMP", "TMP")


@contextmanager
def fresh_place(environment: Mapping[str, str] | None = None) -> Iterator[tuple[Path, dict[str, str]]]:
    """Yield a new working folder, and an environment with a new home, cache and temporary folder.

    Everything else of the environment stays. So do downloaded weights
    (:data:`~pytest_libero_max.machine.WEIGHTS`), which need not be downloaded again, and packages that were
    installed for the user.

    Args:
        environment: Environment to begin with; by default that of this process.
    """
    with TemporaryDirectory(prefix="libero-max-") as name:
        working, home, temporary = (Path(name, part) for part in ("working", "home", "temporary"))
        for folder in (working, home, temporary):
            folder.mkdir()
        fresh = dict(os.environ if environment is None else environment)
        for variable, weights in weight_folders().items():
            fresh.setdefault(variable, str(weights))
        fresh.setdefault("PYTHONUSERBASE", site.getuserbase())
        fresh = {variable: value for variable, value in fresh.items() if variable not in _OF_A_USER}
        yield working, fresh | {"HOME": str(home)} | dict.fromkeys(_TEMPORARY, str(temporary))
