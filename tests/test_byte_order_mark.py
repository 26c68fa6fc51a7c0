"""Files that people write are read with the byte-order mark that some editors begin them with."""

from __future__ import annotations

import codecs
import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import pytest_libero_max
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.programs import load_program
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.cli.ini_file import ini_lines
from pytest_libero_max.policies.clients.servers import read_servers
from pytest_libero_max.policies.profile import load_profile
from pytest_libero_max.policies.transforms.actions import read_statistics

PACKAGE = Path(pytest_libero_max.__file__).parent
STATISTICS = json.dumps({"a": {"action": {"min": [0] * 7, "max": [1] * 7, "mask": [True] * 7}}})


def manifest() -> str:
    return load_track("smoke").to_json()


def program() -> str:
    return next((PACKAGE / "benchmark" / "named_programs").glob("*.json")).read_text(encoding="utf-8")


FILES: dict[str, tuple[Callable[[], str], Callable[[Path], Any]]] = {
    "manifest.json": (manifest, load_manifest),
    "manifest.json.gz": (manifest, load_manifest),
    "program.json": (program, load_program),
    "profile.toml": (lambda: 'extends = "pi05_libero"\n', lambda path: load_profile(str(path)).digest),
    "servers.toml": (
        lambda: '[[servers]]\naddress = "openpi://a"\nprofile = "pi05_libero"\n',
        lambda path: read_servers(str(path), None).digest,
    ),
    "statistics.json": (lambda: STATISTICS, lambda path: repr(read_statistics(path))),
    "pytest.toml": (lambda: '[pytest]\nx = ["1"]\n', lambda path: ini_lines("x", path.parent)),
    "pytest.ini": (lambda: "[pytest]\nx = 1\n", lambda path: ini_lines("x", path.parent)),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_with_a_byte_order_mark_is_read_as_without(name: str, tmp_path: Path) -> None:
    written, read = FILES[name]
    path, content = tmp_path / name, written().encode()
    values = []
    for whole in (content, codecs.BOM_UTF8 + content):
        path.write_bytes(gzip.compress(whole) if name.endswith(".gz") else whole)
        values.append(read(path))
    assert values[0] == values[1]


def test_a_released_manifest_is_recognised_with_the_mark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pytest_libero_max.benchmark import manifests

    seen: list[bytes] = []
    monkeypatch.setattr(manifests, "recognise", lambda content, *rest: seen.append(content))
    content = manifest().encode()
    manifests.decode_manifest(codecs.BOM_UTF8 + content, tmp_path / "mine.json")
    assert set(seen) == {content}


def test_every_file_of_toml_is_read_by_the_same_function() -> None:
    places = {
        (path.name, line.strip())
        for path in PACKAGE.rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if "tomllib.load" in line
        and "tomllib.loads(read_text(" not in line
        and 'tomllib.loads(f"' not in line  # arguments in an option
    }
    assert not places
