"""Finding a genuine installation and telling which of the four it is, without importing it.

All of them import as ``libero``, so the import name says nothing and one process can use one of them only.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

from pytest_libero_max.errors import SubstrateError

Flavour = Literal["hf-libero", "LIBERO", "LIBERO-Plus", "LIBERO-PRO"]

INSTALL = "pip install --no-deps hf-libero==0.1.4 bddl==1.0.1"
"""Without its dependencies: evaluation needs a tenth of them, and its pins contradict ours."""

REQUIREMENTS = ("bddl", "easydict", "future", "yaml", "matplotlib", "cloudpickle", "gymnasium", "networkx")
"""Modules that the environments import besides ours, by import name."""

REQUIREMENTS_INSTALL = "pip install easydict future pyyaml matplotlib cloudpickle gymnasium networkx"

NOISE_REQUIREMENTS = ("skimage", "wand")
"""What LIBERO-Plus's sensor noise needs besides; Wand also needs ImageMagick's libraries."""

NOISE_CURE = "`pip install scikit-image wand`, and Debian's libmagickwand-dev or ImageMagick's own libraries"

_ASSETS_CURES = {
    "hf-libero": "download the data set lerobot/libero-assets (`hf download --repo-type dataset "
    "lerobot/libero-assets`)",
    "LIBERO": "restore it from the checkout's repository",
    "LIBERO-Plus": "download assets.zip of the data set Sylvest/LIBERO-plus and unpack it there",
    "LIBERO-PRO": "restore it from the repository, or from the data set zhouxueyang/LIBERO-Pro",
}

_HUB_FOLDER = "datasets--lerobot--libero-assets"


@dataclass(frozen=True)
class Installation:
    """One LIBERO on this machine.

    Attributes:
        flavour: Which of the four it is.
        root: The folder that holds the outer package ``libero``.
        assets: Models and textures.
        bddl: Task descriptions, ``<suite>/<task>.bddl``.
        states: Initial states, ``<suite>/<task>.pruned_init``.
    """

    flavour: Flavour
    root: Path
    assets: Path
    bddl: Path
    states: Path

    @property
    def package(self) -> Path:
        """The inner package, ``libero.libero``."""
        return self.root / "libero" / "libero"

    @cached_property
    def version(self) -> str:
        """The distribution's version, the commit of a checkout, or ``unknown``."""
        if self.flavour == "hf-libero":
            try:
                return version("hf-libero")
            except PackageNotFoundError:
                return "unknown"
        return _commit(self.root) or "unknown"

    @cached_property
    def sources(self) -> str:
        """SHA-256 over the environments' source files, hexadecimal."""
        return _digest((path, path.read_bytes()) for path in _files(self.package / "envs", ".py"))

    @cached_property
    def contents(self) -> str:
        """SHA-256 over the names and sizes of all assets, hexadecimal: their content may be gigabytes."""
        sizes = ((path, str(path.stat().st_size).encode()) for path in _files(self.assets))
        return _digest((path.relative_to(self.assets), size) for path, size in sizes)

    @property
    def assets_cure(self) -> str:
        """What to do about models or textures that are not there."""
        return _ASSETS_CURES[self.flavour]

    def __str__(self) -> str:
        return f"{self.flavour} {self.version[:12]}"


def find_installation(
    root: Path | None = None,
    *,
    assets: Path | None = None,
    bddl: Path | None = None,
    states: Path | None = None,
) -> Installation:
    """Locate an installation.

    The configuration file that LIBERO keeps in the home directory is not consulted: it is shared by all
    of them, and as often as not it names the folders of another.

    Args:
        root: A checkout, or the folder of site-packages. None: whatever ``import libero`` would find.
        assets: Models and textures, where the package has none of its own.
        bddl: Task descriptions, likewise.
        states: Initial states, likewise.

    Raises:
        SubstrateError: There is none, or a folder is missing; the message has the commands that help.
    """
    root = _importable() if root is None else _checked_root(root)
    package = root / "libero" / "libero"
    flavour = recognise(package)
    found = Installation(
        flavour=flavour,
        root=root,
        assets=_assets(package, flavour, assets),
        bddl=bddl or package / "bddl_files",
        states=states or package / "init_files",
    )
    for what in ("assets", "bddl", "states"):
        folder = getattr(found, what)
        if not folder.is_dir():
            raise SubstrateError(_missing(found, what, folder))
    return found


def recognise(package: Path) -> Flavour:
    """Which LIBERO the inner package is, from files that only one of them has."""
    if (package / "benchmark" / "task_classification.json").exists():
        return "LIBERO-Plus"
    root = package.parent.parent
    pro_files = (
        root / "libero_ood",
        root / "evaluation_config.yaml",
        package / "envs" / "robustness_perturbations.py",
        package / "envs" / "perturbation_config.py",
        package.parent / "evaluation" / "perturbation.py",
        package / "evaluation" / "perturbation.py",
    )
    if any(path.exists() for path in pro_files):
        return "LIBERO-PRO"
    source = (package / "__init__.py").read_text(encoding="utf-8", errors="replace")
    return "hf-libero" if "def get_assets_path" in source else "LIBERO"


def missing_requirements() -> list[str]:
    """Modules that every installation needs and that cannot be found, by import name."""
    return [name for name in REQUIREMENTS if not importable(name)]


def importable(name: str) -> bool:
    """Whether a module can be found, without importing it."""
    if name in sys.modules:
        return True
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


def _importable() -> Path:
    # Not importlib.util.find_spec: it answers with what has been imported already, which may be another.
    specs = (finder.find_spec("libero", None) for finder in sys.meta_path if hasattr(finder, "find_spec"))
    spec = next((found for found in specs if found is not None), None)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        if (Path(folder) / "libero" / "__init__.py").exists():
            return Path(folder).resolve().parent
    raise SubstrateError(
        "No LIBERO is installed, so the substrate 'libero' cannot be used. Install it with "
        f"`{INSTALL}` and `{REQUIREMENTS_INSTALL}`, or give the folder of a checkout of LIBERO, LIBERO-Plus "
        "or LIBERO-PRO. `libero-max doctor` says what is missing."
    )


def _checked_root(root: Path) -> Path:
    for candidate in (root, root.parent, root.parent.parent):
        if (candidate / "libero" / "libero" / "__init__.py").exists():
            return candidate.resolve()
    raise SubstrateError(
        f"{str(root)!r} holds no LIBERO: libero/libero/__init__.py is not in it. Give the folder of a "
        "checkout of LIBERO, LIBERO-Plus or LIBERO-PRO."
    )


def _assets(package: Path, flavour: Flavour, elsewhere: Path | None) -> Path:
    own = package / "assets"
    if own.is_dir():
        return own
    if elsewhere is not None:
        return elsewhere.absolute()
    if flavour == "hf-libero":
        home = os.environ.get("HF_HOME") or "~/.cache/huggingface"
        hub = os.environ.get("HF_HUB_CACHE") or Path(home, "hub")
        snapshots = Path(hub).expanduser() / _HUB_FOLDER / "snapshots"
        downloaded = sorted(snapshots.iterdir()) if snapshots.is_dir() else []
        if downloaded:
            return downloaded[-1]
    return own


def _missing(found: Installation, what: str, folder: Path) -> str:
    cure = "restore it from the package"
    if what == "assets":
        cure = f"{found.assets_cure}, or name the folder with --libero-max-libero-assets"
    return (
        f"{found.flavour} in {str(found.root)!r} has no {what} folder: {str(folder)!r} does not exist. "
        f"Nothing is downloaded during a run; {cure}."
    )


def _files(folder: Path, suffix: str = "") -> list[Path]:
    return sorted(path for path in folder.rglob(f"*{suffix}") if path.is_file())


def _digest(items: Iterable[tuple[Path, bytes]]) -> str:
    digest = hashlib.sha256()
    for path, content in items:
        digest.update(path.name.encode() if path.is_absolute() else path.as_posix().encode())
        digest.update(b"\0" + hashlib.sha256(content).digest())
    return digest.hexdigest()


def _commit(root: Path) -> str | None:
    """The commit that a checkout is at, read from its files: git itself may not be there."""
    folder = root / ".git"
    try:
        if folder.is_file():  # a work tree names the repository it belongs to
            folder = (root / folder.read_text().partition("gitdir:")[2].strip()).resolve()
        head = (folder / "HEAD").read_text().strip()
        if not head.startswith("ref:"):
            return head
        name = head.partition(":")[2].strip()
        common = folder / "commondir"
        shared = (folder / common.read_text().strip()).resolve() if common.exists() else folder
        if (shared / name).exists():
            return (shared / name).read_text().strip()
        packed = (shared / "packed-refs").read_text()
        match = re.search(rf"^([0-9a-f]{{40}}) {re.escape(name)}$", packed, re.MULTILINE)
        return match.group(1) if match else None
    except OSError:
        return None
