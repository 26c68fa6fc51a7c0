"""The files that loading a policy reads: weights, statistics and settings are part of its identity.

Python announces each file that it opens (:func:`sys.addaudithook`). Readers in other languages do not: files
that are mapped or still open when the policy is loaded are found by the system's tables, and ``safe_open`` of
safetensors is asked by a function that notes its argument. What another native reader has read and closed
again is not seen, and neither is what a policy reads first in ``predict``: only loading and ``reset`` are
watched. A policy with such a reader declares ``PolicySpec(revision=...)``, which replaces all this.

A file counts unless it belongs to the system or to the installed Python, is imported, lies in a hidden folder
of the home folder (other than downloaded weights, :func:`~pytest_libero_max.machine.weight_folders`), or is a
temporary file outside the policy's folder and the working folder. One that was written since loading began is
named and not compared: the policy may have made it. One that has changed since the run began says so, because
an earlier process of the run may have made it: it is compared only with the same file from before the run.
"""

from __future__ import annotations

import hashlib
import os
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib import import_module
from inspect import currentframe
from pathlib import Path
from stat import S_ISREG
from time import time_ns
from types import FrameType
from typing import Any, TypeAlias

from pytest_libero_max.machine import weight_folders

FileIdentity: TypeAlias = dict[str, int | str]
"""``bytes`` and ``sha256``; of a large file ``bytes``, ``modified`` and ``sampled_sha256``; of a file in the
cache of a hub ``bytes`` and ``blob``, the name that the hub gives its content; of one that the policy may
have written ``written``. ``changed`` says that it has changed since the run began."""

WRITTEN, CHANGED = "written", "changed"

WHOLE_BYTES = 64 * 2**20
"""Largest file of which all bytes are read; of a larger one, :data:`SAMPLES` blocks, evenly spread."""

SAMPLES, BLOCK_BYTES = 1024, 4096

_SYSTEM = tuple(map(Path, ("/proc", "/sys", "/dev", "/etc", "/usr", "/lib", "/lib64", "/bin", "/run")))
_CODE = (".pyc", ".pyi", ".so")
_CLOCK_NS = 20_000_000  # the clock of the times of files stands still for some milliseconds
_MADE = ("__pycache__", ".git", ".locks", ".no_exist")
_HUB = "blobs"
_METADATA = (".dist-info", ".egg-info")
"""Endings of the folders that describe an installed package, which whoever looks for entry points reads."""


class FilesRead:
    """Collects the files that a policy opens while it is loaded or reset; one for each process.

    The name of a file is its path in the policy's folder or among downloaded weights, and that of the file
    alone elsewhere, so that it is the same on every machine.
    """

    def __init__(self) -> None:
        self.files: dict[str, FileIdentity] = {}
        # Those that reset has read since, and loading had not, or not with this content.
        self.reset_files: dict[str, FileIdentity] = {}
        self._found: dict[str, bool] | None = None  # by path, if it is read; None while nothing is collected
        self._folder: Path | None = None
        self._code: frozenset[Path] = frozenset()
        self._begun_ns = 0
        self._run_begun_ns = 0
        self._hooked = False
        self._digests: dict[tuple[str, int, int], FileIdentity] = {}

    @contextmanager
    def loading(
        self, folder: Path | None, code: Iterable[Path] = (), run_begun_s: float | None = None
    ) -> Iterator[None]:
        """Collect the files of a policy that is loaded in the block; what was known before is forgotten."""
        if not self._hooked:  # a hook stays until the process ends
            sys.addaudithook(self._hear)
            self._hooked = True
        self.files, self.reset_files = {}, {}
        self._folder, self._code = folder, frozenset(code)
        self._begun_ns = time_ns() - _CLOCK_NS
        self._run_begun_ns = self._begun_ns if run_begun_s is None else int(run_begun_s * 10**9)
        before = {*_open_or_mapped()}
        with self._collecting() as opened:
            yield
        self.files = self._identified(opened | dict.fromkeys({*_open_or_mapped()} - before - {*opened}, True))

    @contextmanager
    def resetting(self) -> Iterator[None]:
        """Collect the files that ``reset`` reads, if the policy was loaded in :meth:`loading`."""
        if not self._begun_ns:
            yield
            return
        with self._collecting() as opened:
            yield
        for name, identity in self._identified(opened).items():
            if self.files.get(name) != identity:
                self.reset_files[name] = identity

    def note(self, name: object, *, is_read: bool = True) -> None:
        """Note a file that is read or written, if files are being collected."""
        if self._found is not None and (path := _path(name)) is not None:
            self._found[path] = is_read or self._found.get(path, False)

    @contextmanager
    def _collecting(self) -> Iterator[dict[str, bool]]:
        self._found = opened = dict[str, bool]()
        try:
            with _noting_safetensors(self.note):
                yield opened
        finally:
            self._found = None

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        # Called for every event of the process: the first comparison has to be the cheapest.
        if self._found is None or event not in ("open", "os.rename"):
            return
        if event == "os.rename":
            self.note(arguments[1], is_read=False)
            return
        name, _, flags = arguments
        if str(name).endswith(".py") and _is_import(currentframe()):
            return
        self.note(name, is_read=flags & os.O_ACCMODE != os.O_WRONLY and not flags & os.O_TRUNC)

    def _identified(self, paths: Mapping[str, bool]) -> dict[str, FileIdentity]:
        identities: dict[str, FileIdentity] = {}
        for path, is_read in sorted(paths.items()):
            with suppress(OSError):  # it is gone, or cannot be read any more
                if self._counts(Path(path)) and (is_read or Path(path).stat().st_mtime_ns >= self._begun_ns):
                    name = _name(Path(path), self._folder)
                    if name in identities:  # of the same name, in another folder
                        name = "/".join(Path(path).parts[-2:])
                    identities[name] = self._identity(path)
        return identities

    def _identity(self, path: str) -> FileIdentity:
        real = Path(os.path.realpath(path))
        status = real.stat()
        if status.st_mtime_ns >= self._begun_ns:
            return {WRITTEN: "since loading began"}
        if real.parent.name == _HUB and _inside(real, weight_folders().values()):
            return {"bytes": status.st_size, "blob": real.name}
        key = str(real), status.st_size, status.st_mtime_ns
        if key not in self._digests:
            self._digests[key] = _digest(real, status)
        changed = status.st_mtime_ns >= self._run_begun_ns
        return self._digests[key] | ({CHANGED: "since the run began"} if changed else {})

    def _counts(self, path: Path) -> bool:
        """Return True if a file belongs to the identity of the policy."""
        if path.suffix == ".py" and (
            self._folder is None
            or not path.is_relative_to(self._folder)
            or Path(os.path.realpath(path)) in self._code
        ):
            return False
        return _counts(path, self._folder, self._begun_ns)


FILES_READ = FilesRead()
"""The files that the policy of this process reads."""


def _is_import(frame: FrameType | None) -> bool:
    """Return True if an import called the function: it opens a file, or the compiled form of one."""
    caller = None if frame is None else frame.f_back
    return caller is not None and caller.f_globals.get("__name__") == "importlib._bootstrap_external"


def _path(name: object) -> str | None:
    """Return the absolute path of a file that is opened by name; None for a descriptor."""
    if isinstance(name, int):
        return None
    try:
        return os.path.abspath(os.fsdecode(name))  # type: ignore[arg-type]  # others raise
    except (TypeError, ValueError, OSError):
        return None


def _digest(path: Path, status: os.stat_result) -> FileIdentity:
    with path.open("rb") as file:
        if status.st_size <= WHOLE_BYTES:
            return {"bytes": status.st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}
        digest = hashlib.sha256()
        for number in range(SAMPLES):
            file.seek(number * (status.st_size - BLOCK_BYTES) // (SAMPLES - 1))
            digest.update(file.read(BLOCK_BYTES))
    modified = datetime.fromtimestamp(status.st_mtime_ns // 10**9, UTC).isoformat()
    return {"bytes": status.st_size, "modified": modified, "sampled_sha256": digest.hexdigest()}


def _counts(path: Path, folder: Path | None, begun_ns: int) -> bool:
    real = Path(os.path.realpath(path))
    status = real.stat()
    if not S_ISREG(status.st_mode) or real.suffix in _CODE or {*path.parts} & {*_MADE}:
        return False
    if path.parent.suffix in _METADATA:
        return False
    # This package and the installed Python, whose packages have versions.
    names = ("stdlib", "platstdlib", "purelib", "platlib")
    installed = [Path(__file__).parents[1], Path(sys.prefix), *map(Path, map(sysconfig.get_path, names))]
    if _inside(real, _SYSTEM) or _inside(path, installed):
        return False
    if _inside(path, [*filter(None, [folder]), Path.cwd(), *weight_folders().values()]):
        return True
    home = Path.home()
    if path.is_relative_to(home) and any(part.startswith(".") for part in path.relative_to(home).parts):
        return False
    return not (_inside(path, [Path(tempfile.gettempdir())]) and status.st_mtime_ns >= begun_ns)


def _inside(path: Path, folders: Iterable[Path]) -> bool:
    return any(path.is_relative_to(folder) for folder in folders)


def _name(path: Path, folder: Path | None) -> str:
    for place in (folder, *weight_folders().values()):
        if place is not None and path.is_relative_to(place):
            return path.relative_to(place).as_posix()
    return path.name


def _open_or_mapped() -> Iterator[str]:
    """Yield the files that this process has open or mapped; none where the system does not tell."""
    with suppress(OSError):
        for link in Path("/proc/self/fd").iterdir():
            with suppress(OSError):
                yield str(link.readlink())
    with suppress(OSError):
        for line in Path("/proc/self/maps").read_text(errors="replace").splitlines():
            _, _, path = line.partition("/")
            if path and " (deleted)" not in path:
                yield f"/{path}"


@contextmanager
def _noting_safetensors(note: Any) -> Iterator[None]:
    """Let ``safetensors.safe_open`` note its argument in the block: it opens files in Rust."""
    try:
        opened = import_module("safetensors").safe_open
    except (ImportError, AttributeError):
        yield
        return

    class NotedSafeOpen:
        """``safe_open`` that notes the file; what it returns is the real one."""

        def __new__(cls, filename: Any, *args: Any, **how: Any) -> Any:
            note(filename)
            return opened(filename, *args, **how)

    holders = [
        module
        for name, module in list(sys.modules.items())
        if name.partition(".")[0] == "safetensors" and vars(module).get("safe_open") is opened
    ]
    for module in holders:
        module.safe_open = NotedSafeOpen  # type: ignore[attr-defined]
    try:
        yield
    finally:
        for module in holders:
            module.safe_open = opened  # type: ignore[attr-defined]
