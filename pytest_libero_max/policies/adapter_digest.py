"""Digest of an adapter's code, by which a later run finds that it plays another policy."""

from __future__ import annotations

import ast
import hashlib
import sysconfig
from collections.abc import Iterable, Iterator
from pathlib import Path

from pytest_libero_max.benchmark.source_digest import code_digest
from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.clients.address import is_address
from pytest_libero_max.policies.references import (
    Reference,
    file_of,
    find_spec,
    parse_reference,
    submodule_file,
)

_OWN_PACKAGE = __name__.partition(".")[0]


def adapter_digest(text: str, profile: str | None = None) -> str:
    """SHA-256 of the code that a reference leads to, hexadecimal. Nothing is imported.

    For the address of a server it is that of the profile: what is asked, not where.

    It covers the adapter's file, the name taken from it, and every module that the code imports (anywhere,
    also inside a function) from the adapter's own folder or package. Comments, docstrings and layout do not
    count; neither does where the folder lies. It does not cover installed packages, whose versions are
    recorded elsewhere, nor weights and other data, for which an adapter declares ``PolicySpec.revision``, nor
    modules whose names are computed at run time.

    Args:
        text: The reference as the user typed it.
        profile: Name or path of the profile, for the address of a server.

    Raises:
        AdapterError: The reference leads nowhere, or a file cannot be read.
    """
    if is_address(text):
        from pytest_libero_max.policies.clients.opening import require_profile

        return require_profile(text, profile).digest
    reference = parse_reference(text)
    try:
        code = code_digest(adapter_files(reference))
    except OSError as error:
        raise AdapterError.seen(
            "policy", text, f" cannot be read ({error}). Check the file's permissions."
        ) from None
    return hashlib.sha256(f"{reference.name}|{code}".encode()).hexdigest()


def adapter_files(reference: Reference) -> tuple[Path, ...]:
    """The adapter's file and those it imports from its own folder or package, sorted.

    Raises:
        AdapterError: The reference leads nowhere.
        OSError: A file cannot be read.
    """
    first = file_of(reference)
    if first is None:
        return ()
    folder, inside = _scope(reference, first)
    found: set[Path] = set()
    new = {first, *([] if reference.is_file else _files(tuple(reference.target.split(".")), folder, inside))}
    while new:
        found |= new
        names = {name for file in new for name in _imported(file, folder) if name[: len(inside)] == inside}
        new = {helper for name in names for helper in _files(name, folder, inside)} - found
    return tuple(sorted(found))


def _scope(reference: Reference, first: Path) -> tuple[Path | None, tuple[str, ...]]:
    """The folder in which the adapter's helpers are looked for, and how their dotted names begin."""
    top, *rest = reference.target.split(".")
    if reference.is_file or (not rest and first.stem == top):
        installed = {Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib")}
        return (None if first.parent in installed else first.parent), ()
    folder = first.parents[len(rest) + (first.stem == "__init__")]
    # Of this package only the room of the scripted policies: the rest is the instrument, and has a version.
    return folder, (top, "experts") if top == _OWN_PACKAGE else (top,)


def _imported(file: Path, folder: Path | None) -> Iterator[tuple[str, ...]]:
    """Dotted names that a file imports and that may lie below ``folder``."""
    if file.suffix != ".py" or folder is None:
        return
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from _ours((tuple(alias.name.split(".")) for alias in node.names), folder)
        elif isinstance(node, ast.ImportFrom):
            base = tuple(node.module.split(".")) if node.module else ()
            names = [(*base, alias.name) for alias in node.names]
            if node.level == 0:
                yield from _ours(names, folder)
            elif file.is_relative_to(folder):
                package = file.relative_to(folder).parts[: -node.level]
                yield from ((*package, *name) for name in names)


def _ours(names: Iterable[tuple[str, ...]], folder: Path) -> Iterator[tuple[str, ...]]:
    """Those of the absolute names that are not found elsewhere on the import path first."""
    for name in names:
        spec = find_spec(name[0])
        places = [] if spec is None else [spec.origin, *(spec.submodule_search_locations or ())]
        if spec is None or any(place and Path(place).resolve().is_relative_to(folder) for place in places):
            yield name


def _files(name: tuple[str, ...], folder: Path | None, inside: tuple[str, ...]) -> Iterator[Path]:
    """The files below ``inside`` that an import of a dotted name executes: its packages' and its own."""
    for length in range(max(1, len(inside)), len(name) + 1):
        file = None if folder is None else submodule_file([str(folder)], name[:length])
        if file is not None:
            yield file.resolve()
