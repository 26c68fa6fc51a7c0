"""Fingerprint of this installation, kept by ``libero-max lab fingerprint`` for the runs that follow.

Taking it costs a quarter of a minute, too much for every run. It is kept under everything that it may depend
on and that is known without a simulator: where one of these has changed, it has to be taken again.
"""

from __future__ import annotations

import hashlib
import os
import platform
from functools import cache
from pathlib import Path

from pytest_libero_max.benchmark.documents import Json, canonical_digest
from pytest_libero_max.machine import user_cache
from pytest_libero_max.runs.provenance import package_versions, processor

_DRAWING = ("MUJOCO_GL", "GALLIUM_DRIVER", "LIBGL_ALWAYS_SOFTWARE", "EGL_PLATFORM", "OPENBLAS_CORETYPE")
"""Environment variables that choose a renderer, or the kernels of linear algebra."""

_PACKAGE = Path(__file__).resolve().parents[1]


def keep(substrate: Json, fingerprint: str) -> None:
    """Keep the fingerprint of this installation; without a place to write to, nothing is kept.

    Args:
        substrate: The substrate, as the provenance of a run describes it.
        fingerprint: The hash to quote.
    """
    path = _path(substrate)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{fingerprint}\n", encoding="utf-8")
    except OSError:
        pass


def kept(substrate: Json) -> str | None:
    """Return the fingerprint that was kept of this very installation; None for none."""
    if not _folder().is_dir():
        return None
    try:
        return _path(substrate).read_text(encoding="utf-8").strip() or None
    except (OSError, UnicodeDecodeError):
        return None


def fingerprint_text(provenance: Json) -> str:
    """Return the fingerprint of a run as reports print it."""
    return str(provenance["fingerprint"] or "not taken before the run (libero-max lab fingerprint)")


def _folder() -> Path:
    return user_cache() / "pytest-libero-max" / "fingerprints"


def _path(substrate: Json) -> Path:
    known = {
        "substrate": substrate,
        "versions": package_versions(),
        "python": platform.python_version(),
        "machine": [platform.machine(), processor(), *platform.libc_ver()],
        "drawing": {name: os.environ.get(name) for name in _DRAWING},
        "code": _code(),
    }
    return _folder() / canonical_digest(known)[:32]


@cache
def _code() -> str:
    """Return a digest of the files of this package."""
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")) + sorted(_PACKAGE.rglob("*.toml")):
        digest.update(f"{path.relative_to(_PACKAGE)}\n".encode() + path.read_bytes())
    return digest.hexdigest()
