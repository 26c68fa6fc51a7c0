"""Resources of this machine: memory, disk space, the user's cache; and how a process ends with its parent."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType

GIB = 2**30

_M_MMAP_THRESHOLD = -3
_LARGE_BLOCK_BYTES = 2**20

_CACHE_VARIABLE = "XDG_CACHE_HOME"
_PARENT_DEATH_SIGNAL = 1
"""Operation of ``prctl``: which signal a process gets when its parent dies."""

_CGROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def memory_bytes() -> int:
    """Memory that processes here may use together: that of the machine, or less in a container."""
    least = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for path in _CGROUP_LIMITS:
        try:
            text = Path(path).read_text().strip()
        except OSError:
            continue
        if text.isdigit():  # "max" where there is no limit
            least = min(least, int(text))
    return least


def available_bytes() -> int | None:
    """Memory that is free now, or can be freed; None where the kernel does not tell."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:")), None)


def end_with_parent() -> None:
    """Let the kernel kill this process when its parent dies."""
    parent = os.getppid()
    ctypes.CDLL(None).prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:  # it died meanwhile
        os._exit(1)


def limit_private_bytes(most: int) -> None:
    """Let this process, and those it starts, have no more private memory than this (``RLIMIT_DATA``).

    Counted is memory that only the process itself can write: all that it has requested, used or not. Files
    that are only read, and the addresses that graphics drivers reserve, are not counted, as they would be
    under ``RLIMIT_AS``. Beyond the limit the kernel gives no more, so an allocation without end fails at
    once, in Python with a ``MemoryError``; a thread that looks at the memory now and then would be late, and
    cannot run while native code holds the interpreter.
    """
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard != resource.RLIM_INFINITY:
        most = min(most, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def return_large_blocks() -> None:
    """Let the C library give a large block back to the kernel as soon as it is freed.

    glibc raises the size from which it does so with every large block that is freed, up to 32 MiB. Scenes of
    some 20 MB that come and go then leave holes in the heap, and a worker grows with each scene it builds.
    A fixed size ends that. Other C libraries are left as they are.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGE_BLOCK_BYTES)


def return_free_memory() -> None:
    """Let the C library give the kernel what is free in its heap: the many small blocks of a closed scene.

    Without this they stay between blocks that are in use, and a worker grows for its first hundred pairs. It
    takes 2 to 4 ms. Other C libraries than glibc are left as they are.
    """
    malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if malloc_trim is not None:
        malloc_trim(0)


def free_disk_bytes(folder: Path) -> int | None:
    """Room on the disk of a folder, which need not exist yet; None where it cannot be looked at."""
    for path in (folder, *folder.absolute().parents):
        try:
            status = os.statvfs(path)
        except FileNotFoundError:
            continue
        except OSError:
            return None
        return status.f_bavail * status.f_frsize
    return None


def user_cache() -> Path:
    """Folder of the user's cache: ``XDG_CACHE_HOME`` where that is an absolute path, else ``~/.cache``.

    So says the XDG Base Directory Specification: an empty variable is as good as none, and a relative path
    is to be ignored.
    """
    named = os.environ.get(_CACHE_VARIABLE, "")
    return Path(named) if Path(named).is_absolute() else Path.home() / ".cache"


@contextlib.contextmanager
def named_user_cache() -> Iterator[None]:
    """Let others find :func:`user_cache` in the block: Numba takes an empty variable for the current one."""
    before = os.environ.get(_CACHE_VARIABLE)
    if before is None:
        yield
        return
    os.environ[_CACHE_VARIABLE] = str(user_cache())
    try:
        yield
    finally:
        os.environ[_CACHE_VARIABLE] = before


WEIGHTS = MappingProxyType({"HF_HOME": "huggingface", "TORCH_HOME": "torch", "OPENPI_DATA_HOME": "openpi"})
"""Variables for folders of downloaded weights, with their folder in the user's cache unless they are set."""


def weight_folders() -> dict[str, Path]:
    """Return the folders of downloaded weights that exist, by variable."""
    folders = {
        variable: Path(os.environ.get(variable) or user_cache() / name).absolute()
        for variable, name in WEIGHTS.items()
    }
    return {variable: folder for variable, folder in folders.items() if folder.is_dir()}
