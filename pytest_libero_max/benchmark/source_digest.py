"""Digest of what Python code says: comments, docstrings and layout do not count."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any


def code_digest(paths: Iterable[Path]) -> str:
    """SHA-256 of the code in some files, hexadecimal.

    A Python file counts as its syntax tree: comments, docstrings, layout and the version of Python make no
    difference. Any other file (an extension module, or one that does not parse) counts as its bytes. Where a
    file lies and the order of the files make no difference either; its name does.

    Args:
        paths: The files.

    Raises:
        OSError: A file cannot be read.
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
    """A syntax tree as nested tuples; empty fields are left out, because their number grows with Python.

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
    """Whether a statement is nothing but a string: a docstring, or a note below a constant."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
