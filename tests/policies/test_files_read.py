"""The files that belong to the identity of a policy, however they are read."""

from __future__ import annotations

import ctypes
import hashlib
import json
import mmap
import os
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.policies import files_read
from pytest_libero_max.policies.files_read import FileIdentity, FilesRead

NATIVE = '''
import ctypes, os

class safe_open:
    """Opens the file as Rust does, of which Python hears nothing."""

    def __init__(self, filename, framework="np"):
        libc = ctypes.CDLL(None)
        descriptor = libc.open(os.fsencode(filename), os.O_RDONLY)
        assert descriptor >= 0
        libc.close(descriptor)
'''


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a policy, with a home, a working and a temporary folder of its own."""
    for name in ("policy", "home", "working", "temporary"):
        (tmp_path / name).mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    monkeypatch.chdir(tmp_path / "working")
    return tmp_path / "policy"


def _file(path: Path, content: bytes = b"weights") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    os.utime(path, (1_700_000_000, 1_700_000_000))
    return path


def read_by(read: Callable[[], object], folder: Path) -> dict[str, FileIdentity]:
    collector = FilesRead()
    with collector.loading(folder):
        kept = read()
    del kept
    return collector.files


def _native(path: Path) -> object:
    import safetensors  # type: ignore[import-not-found,unused-ignore]

    return safetensors.safe_open(path)


def _mapped(path: Path) -> object:
    """Map a file as native readers do, without Python's ``open``."""
    libc = ctypes.CDLL(None)
    descriptor = libc.open(os.fsencode(path), os.O_RDONLY)
    kept = mmap.mmap(descriptor, 0, prot=mmap.PROT_READ)
    libc.close(descriptor)
    return kept


def _append_nothing(path: Path) -> object:
    with path.open("ab"):
        return path.read_bytes()


def _update(path: Path) -> object:
    with path.open("r+") as file:
        return file.read()


READERS: dict[str, Callable[[Path], object]] = {
    "open": Path.read_bytes,
    "os.open": lambda path: os.close(os.open(path, os.O_RDONLY)),
    "relative": lambda path: Path(os.path.relpath(path)).read_bytes(),
    "np.fromfile": lambda path: np.fromfile(path, np.uint8),
    "np.memmap": lambda path: np.memmap(path, np.uint8, "r"),
    "np.memmap for update": lambda path: np.memmap(path, np.uint8),
    "open for update": _update,
    "os.open for update": lambda path: os.close(os.open(path, os.O_RDWR)),
    "open to append, and read": _append_nothing,
    "mapped": _mapped,
    "safetensors": _native,
}


@pytest.mark.parametrize("how", READERS)
def test_a_file_is_found_however_it_is_read(
    how: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "safetensors", raising=False)
    _file(tmp_path / "packages" / "safetensors" / "__init__.py", NATIVE.encode())
    monkeypatch.syspath_prepend(str(tmp_path / "packages"))
    path = _file(folder / "checkpoints" / "weights.bin")
    kept: list[object] = []
    files = read_by(lambda: kept.append(READERS[how](path)), folder)
    digest = hashlib.sha256(b"weights").hexdigest()
    assert files == {"checkpoints/weights.bin": {"bytes": 7, "sha256": digest}}


def test_the_identity_is_the_content_and_not_the_place(folder: Path, tmp_path: Path) -> None:
    first = read_by(_file(folder / "w.npz").read_bytes, folder)
    (tmp_path / "moved").mkdir()
    other = _file(tmp_path / "moved" / "w.npz")
    os.utime(other, (1, 1))
    assert read_by(other.read_bytes, tmp_path / "moved") == first
    _file(folder / "w.npz", b"others.")
    assert read_by((folder / "w.npz").read_bytes, folder) != first


def test_files_of_the_machine_are_left_out(folder: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    out = [
        Path("/proc/self/status"),
        Path("/etc/hosts"),
        Path(json.__file__),
        Path(files_read.__file__).with_name("README.md"),
        Path(np.__file__).parents[1] / "numpy" / "py.typed",
        _file(folder / "__pycache__" / "loops.nbi"),
        _file(home / ".config" / "settings.json"),
        _file(home / ".cache" / "compiled" / "kernel.bin"),
    ]
    counted = [
        _file(home / "models" / "a.bin"),
        _file(tmp_path / "working" / "b.bin"),
        _file(folder / "c.bin"),
    ]

    def read() -> None:
        for path in (*out, *counted):
            path.read_bytes()
        made = tmp_path / "temporary" / "scratch.bin"
        made.write_bytes(b"1")
        made.read_bytes()

    assert sorted(read_by(read, folder)) == ["a.bin", "b.bin", "c.bin"]


def test_what_the_policy_writes_is_named_and_has_no_digest(folder: Path) -> None:
    path, moved = folder / "answers.json", folder / "moved.json"

    def read() -> None:
        path.write_text("{}")
        path.read_text()

    written = {"written": "since loading began"}
    assert read_by(read, folder) == {"answers.json": written}
    path.unlink()
    assert read_by(lambda: path.write_text("{}"), folder) == {
        "answers.json": written
    }  # though nobody read it
    os.utime(path, (1, 1))
    assert read_by(path.open("a").close, folder) == {}  # opened, and not written

    def replace() -> None:
        (folder / "new").write_text("{}")
        (folder / "new").replace(moved)

    assert read_by(replace, folder) == {"moved.json": written}


def test_a_file_that_changed_since_the_run_began_says_so(folder: Path) -> None:
    path, collector = _file(folder / "w.bin"), FilesRead()
    modified_s = path.stat().st_mtime
    for begun_s, changed in ((modified_s - 1, True), (modified_s + 1, False)):
        with collector.loading(folder, run_begun_s=begun_s):
            path.read_bytes()
        assert ("changed" in collector.files["w.bin"]) is changed


def test_code_counts_as_data_where_it_is_not_imported(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.syspath_prepend(str(folder))
    paths = [_file(folder / f"read_{name}.py", b"W = 1") for name in ("covered", "executed", "imported")]
    collector = FilesRead()
    with collector.loading(folder, code=paths[:1]):
        for path in (*paths[:2], _file(tmp_path / "elsewhere.py")):
            path.read_text()
        import_module("read_imported")
    assert list(collector.files) == ["read_executed.py"]
    assert list(read_by(_file(folder / "weights.pth").read_bytes, folder)) == ["weights.pth"]


def test_downloaded_weights_have_the_name_of_their_blob(folder: Path, tmp_path: Path) -> None:
    hub = tmp_path / "home" / ".cache" / "huggingface" / "hub" / "models--a--b"
    blob = _file(hub / "blobs" / "0123abc")
    link = hub / "snapshots" / "c0ffee" / "model.bin"
    link.parent.mkdir(parents=True)
    link.symlink_to(blob)
    files = read_by(link.read_bytes, folder)
    assert files == {"hub/models--a--b/snapshots/c0ffee/model.bin": {"bytes": 7, "blob": "0123abc"}}


def test_large_files_are_sampled_and_say_so(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files_read, "WHOLE_BYTES", 2**20)
    content = np.random.default_rng(0).integers(0, 256, 9 * 2**20, np.uint8)
    path = _file(folder / "large.bin", content.tobytes())
    first = read_by(path.read_bytes, folder)["large.bin"]
    assert set(first) == {"bytes", "modified", "sampled_sha256"}
    assert first["modified"] == "2023-11-14T22:13:20+00:00"
    content[5 * 2**20 : 5 * 2**20 + 2**15] = 0
    _file(path, content.tobytes())
    assert read_by(path.read_bytes, folder)["large.bin"]["sampled_sha256"] != first["sampled_sha256"]


def test_reset_adds_what_loading_had_not_read(folder: Path) -> None:
    early, late = _file(folder / "early.bin"), _file(folder / "late.bin")
    collector = FilesRead()
    with collector.resetting():  # nothing was loaded
        late.read_bytes()
    assert collector.reset_files == {}
    with collector.loading(folder):
        early.read_bytes()
    late.read_bytes()  # neither loading nor reset
    assert collector.reset_files == {}
    with collector.resetting():
        early.read_bytes()
        late.read_bytes()
    assert list(collector.files) == ["early.bin"]
    assert list(collector.reset_files) == ["late.bin"]
    _file(early, b"other weights")
    with collector.resetting():
        early.read_bytes()
    assert list(collector.reset_files) == ["late.bin", "early.bin"]


def test_files_of_one_name_in_two_folders_are_both_named(folder: Path, tmp_path: Path) -> None:
    paths = [_file(tmp_path / "elsewhere" / name / "w.bin") for name in ("a", "b")]
    files = read_by(lambda: [path.read_bytes() for path in paths], folder)
    assert sorted(files) == ["b/w.bin", "w.bin"]


def test_safetensors_is_as_before_when_the_policy_is_loaded(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "safetensors", raising=False)
    _file(tmp_path / "packages" / "safetensors" / "__init__.py", NATIVE.encode())
    monkeypatch.syspath_prepend(str(tmp_path / "packages"))
    path = _file(folder / "w.safetensors")
    found: list[Any] = []

    def read() -> None:
        import safetensors

        found.append(safetensors.safe_open(path))

    assert list(read_by(read, folder)) == ["w.safetensors"]
    assert type(found[0]) is sys.modules["safetensors"].safe_open
