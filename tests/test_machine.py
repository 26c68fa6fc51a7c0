"""What is set for a whole process is set in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.machine import GIB, memory_bytes, named_user_cache, user_cache
from tests.scripts.measure_memory import private_bytes, resident_bytes

HOLES = """
from pytest_libero_max.machine import return_large_blocks
from tests.scripts.measure_memory import resident_bytes
{call}
import ctypes

libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
libc.malloc.argtypes = [ctypes.c_size_t]
libc.free.argtypes = [ctypes.c_void_p]
libc.free(libc.malloc(30 * 2**20))  # from here on glibc keeps blocks of this size in its heap
before = resident_bytes()
for _ in range(10):
    large = libc.malloc(20 * 2**20)
    ctypes.memset(large, 1, 20 * 2**20)
    small = libc.malloc(1000)  # stays, above the large block
    libc.free(large)
    libc.malloc(2**19)  # takes a part of the hole
print((resident_bytes() - before) // 2**20)
"""


def _grown_mib(call: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", HOLES.format(call=call)], capture_output=True, text=True, check=True
    )
    return int(done.stdout)


def test_large_blocks_are_returned() -> None:
    assert _grown_mib("") > 20
    assert _grown_mib("return_large_blocks()") < 10


SMALL_BLOCKS = """
import ctypes
from pytest_libero_max.machine import return_free_memory
from tests.scripts.measure_memory import resident_bytes

libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
libc.malloc.argtypes = [ctypes.c_size_t]
libc.free.argtypes = [ctypes.c_void_p]
before = resident_bytes()
blocks = [libc.malloc(100_000) for _ in range(500)]
for block in blocks:
    ctypes.memset(block, 1, 100_000)
for number, block in enumerate(blocks):
    if (number + 1) % 50:  # the others stay between them
        libc.free(block)
kept = resident_bytes()
return_free_memory()
print((kept - before) // 2**20, (resident_bytes() - before) // 2**20)
"""


def test_free_memory_between_blocks_in_use_is_returned() -> None:
    done = subprocess.run([sys.executable, "-c", SMALL_BLOCKS], capture_output=True, text=True, check=True)
    kept, rest = map(int, done.stdout.split())
    assert kept > 40
    assert rest < 10


def test_a_limit_on_memory_holds_and_is_a_memory_error() -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from pytest_libero_max.machine import limit_private_bytes\n"
            "limit_private_bytes(2**29)\n"
            "bytearray(2**20)\n"
            "try:\n"
            "    bytearray(2**30)\n"
            "except MemoryError:\n"
            "    print('none left')\n",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "none left\n"


def test_a_process_has_less_than_the_machine() -> None:
    resident, private = resident_bytes(), private_bytes()
    assert private > 0
    assert 0 < resident < memory_bytes()
    assert memory_bytes() > GIB / 4


@pytest.mark.parametrize(
    ("named", "expected"),
    [(None, "home/.cache"), ("", "home/.cache"), ("relative", "home/.cache"), ("/var/mine", "/var/mine")],
)
def test_the_users_cache_is_where_xdg_says(
    named: str | None, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    if named is None:
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", named)
    assert user_cache() == tmp_path / expected
    with named_user_cache():
        assert os.environ.get("XDG_CACHE_HOME") in (None, str(tmp_path / expected))
    assert os.environ.get("XDG_CACHE_HOME") == named
