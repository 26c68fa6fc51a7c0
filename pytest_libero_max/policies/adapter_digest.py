"""Identity of a policy, by which a later run finds out that it plays another one.

A policy that ships with the package has a version that people raise, an adapter the digest of its own code.
"""

from __future__ import annotations

import ast
import hashlib
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.clients.address import is_served
from pytest_libero_max.policies.files_read import FILES_READ
from pytest_libero_max.policies.references import (
    DEFAULT_NAME,
    Reference,
    file_of,
    find_spec,
    parse_reference,
    refusal,
    shipped_version,
    submodule_file,
)


def adapter_digest(text: str, profile: str | None = None, revision: str | None = None) -> str:
    """Identity of the policy that a reference leads to. Nothing is imported.

    For a policy that ships with the package it is a name and a version, for example ``expert version 1``
    (:func:`~.references.shipped_version`). For the address of a server it is the digest of the profile, not
    of the address. For an adapter it is the SHA-256 of its code, hexadecimal.

    That covers the adapter's file, the name taken from it, and every module that the code imports (anywhere,
    also inside a function) from the adapter's own folder or package. Comments, docstrings and layout do not
    count; neither does where the folder lies. It does not cover installed packages, whose versions are
    recorded elsewhere, nor weights and other data, which records name (:mod:`.files_read`), nor
    modules whose names are computed at run time.
    """
    if is_served(text):
        from pytest_libero_max.policies.clients.servers import read_servers

        return read_servers(text, profile, revision).digest
    reference = parse_reference(text)
    version = shipped_version(reference)
    if version is not None:
        module = reference.target.rpartition(".")[2]
        name = module if reference.name == DEFAULT_NAME else f"{module}:{reference.name}"
        return f"{name} version {version}"
    try:
        code = code_digest(adapter_files(reference))
    except OSError as error:
        raise refusal(text, f" cannot be read ({error}). Check the file's permissions.") from None
    return hashlib.sha256(f"{reference.name}|{code}".encode()).hexdigest()


def names_its_files(text: str) -> bool:
    """Return True if the files that loading a policy reads belong to its identity, see :mod:`.files_read`.

    They do not for a policy that ships with the package, which has a version, and not behind a server, whose
    files are read elsewhere.
    """
    if is_served(text):
        return False
    return shipped_version(parse_reference(text)) is None


@contextmanager
def files_read(text: str, run_begun_s: float | None = None) -> Iterator[None]:
    """Collect the files that loading a policy reads in the block, where they belong to its identity."""
    if not names_its_files(text):
        yield
        return
    file, code = file_of(parse_reference(text)), tuple[Path, ...]()
    with suppress(OSError):  # loading says it
        code = adapter_files(parse_reference(text))
    with FILES_READ.loading(None if file is None else file.parent, code, run_begun_s):
        yield


def shown_identity(identity: str) -> str:
    """Return a policy's identity for messages: a version in full, the beginning of a digest."""
    return identity if " " in identity else identity[:12]


def adapter_files(reference: Reference) -> tuple[Path, ...]:
    """Return the adapter's file and those it imports from its own folder or package, sorted."""
    first = file_of(reference)
    if first is None:
        return ()
    folder, inside = _scope(reference, first)
    files: set[Path] = set()
    new = {first, *([] if reference.is_file else _files(tuple(reference.target.split(".")), folder, inside))}
    while new:
        files |= new
        names = {name for file in new for name in _imported(file, folder) if name[: len(inside)] == inside}
        new = {helper for name in names for helper in _files(name, folder, inside)} - files
    return tuple(sorted(files))


def require_separate_helpers(references: Iterable[str]) -> None:
    """Check that adapter files which play in one process import no different helpers by one name."""
    folders: dict[str, Path] = {}
    for text in references:
        reference = None if is_served(text) else parse_reference(text)
        if reference is None or not reference.is_file or (first := file_of(reference)) is None:
            continue
        for file in adapter_files(reference):
            name = file.relative_to(first.parent).parts[0].removesuffix(".py")
            folder = first.parent if file == first else folders.setdefault(name, first.parent)
            if folder != first.parent:
                raise AdapterError(
                    f"helper {name!r} is in {folder} and in {first.parent}, but the policies of both folders "
                    "play in one process, in which a name is one module. Rename one of the two."
                )


def _scope(reference: Reference, first: Path) -> tuple[Path | None, tuple[str, ...]]:
    """Return the folder of the adapter's helpers, and the beginning of their dotted names."""
    top, *rest = reference.target.split(".")
    if reference.is_file or (not rest and first.stem == top):
        installed = {Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib")}
        return (None if first.parent in installed else first.parent), ()
    folder = first.parents[len(rest) + (first.stem == "__init__")]
    return folder, (top,)


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
    """Yield the absolute names that the import path finds in the folder, or nowhere."""
    for name in names:
        spec = find_spec(name[0])
        places = [] if spec is None else [spec.origin, *(spec.submodule_search_locations or ())]
        if spec is None or any(place and Path(place).resolve().is_relative_to(folder) for place in places):
            yield name


def _files(name: tuple[str, ...], folder: Path | None, inside: tuple[str, ...]) -> Iterator[Path]:
    """Yield the files below ``inside`` that an import executes: its packages' and its own."""
    for length in range(max(1, len(inside)), len(name) + 1):
        file = None if folder is None else submodule_file([str(folder)], name[:length])
        if file is not None:
            yield file.resolve()


def code_digest(paths: Iterable[Path]) -> str:
    """SHA-256 of the code in some files, hexadecimal.

    A Python file counts as its syntax tree: comments, docstrings, layout and the version of Python make no
    difference. Any other file (an extension module, or one that does not parse) counts as its bytes. Where a
    file lies and the order of the files make no difference either; its name does.
    """
    digests = sorted((path.name, _digest_of(path)) for path in paths)
    return hashlib.sha256(repr(digests).encode()).hexdigest()


def _digest_of(path: Path) -> str:
    content = path.read_bytes()
    if path.suffix == ".py":
        with suppress(SyntaxError, ValueError):
            content = repr(_plain(ast.parse(content))).encode()
    return hashlib.sha256(content).hexdigest()


def _plain(node: Any) -> Any:
    """Return a syntax tree as nested tuples, without empty fields: their number grows with Python.

    Every worker does it for some 50,000 nodes before its first pair is measured.
    """
    if isinstance(node, list):
        return tuple([_plain(entry) for entry in node if not _is_text(entry)])
    if not isinstance(node, ast.AST):
        return node
    if isinstance(node, ast.Constant):
        return "Constant", type(node.value).__name__, repr(node.value)
    fields: list[Any] = [type(node).__name__]
    for name in node._fields:
        value = _plain(getattr(node, name, None))
        if value is not None and value != ():
            fields.append((name, value))
    return tuple(fields)


def _is_text(node: Any) -> bool:
    """Return True if a statement is a string alone: a docstring, or a note below a constant."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
