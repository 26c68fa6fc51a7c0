"""JSON Schemas as tables: one row a field."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from pytest_libero_max.benchmark.documents import Json


class Field(NamedTuple):
    """One field of a document.

    Attributes:
        path: Keys from the root, joined by dots; ``*`` stands for any key, ``[]`` for the items of a list.
        kind: What it holds, in words.
        text: What it means; empty where the schema does not say.
    """

    path: str
    kind: str
    text: str


def fields_of(schema: Json, definition: str | None = None) -> tuple[Field, ...]:
    """Every field of a document or of one of its definitions.

    A field that refers to a definition is one row that names it; the definition has rows of its own.

    Args:
        schema: The schema.
        definition: A key of its ``$defs``; None for the document itself.
    """
    node = schema if definition is None else schema["$defs"][definition]
    return tuple(_walk(node, ""))


def _walk(node: Json, path: str) -> Iterator[Field]:
    for key, child in node.get("properties", {}).items():
        yield from _field(child, f"{path}.{key}" if path else key)
    extra = node.get("additionalProperties")
    if isinstance(extra, dict):
        yield from _walk(extra, f"{path}.*" if path else "*")
    if isinstance(node.get("items"), dict):
        yield from _walk(node["items"], f"{path}[]")


def _field(node: Json, path: str) -> Iterator[Field]:
    yield Field(path, kind_of(node), str(node.get("description", "")))
    for part in (node, *node.get("oneOf", ())):
        yield from _walk(part, path)


def kind_of(node: Json) -> str:
    """What a field holds, in words, for example ``number or null``."""
    if "$ref" in node:
        return str(node["$ref"]).rpartition("/")[2]
    if "oneOf" in node:
        return " or ".join(sorted((kind_of(part) for part in node["oneOf"]), key=lambda word: word == "null"))
    if "const" in node:
        return _json(node["const"])
    if "enum" in node:
        return ", ".join(map(_json, node["enum"]))
    if isinstance(node.get("additionalProperties"), dict):
        return f"object of {kind_of(node['additionalProperties'])}"
    kinds = node.get("type", "any")
    return _bounded(node, " or ".join(kinds) if isinstance(kinds, list) else str(kinds))


def _bounded(node: Json, kind: str) -> str:
    low, high = node.get("minimum"), node.get("maximum")
    if low is not None and high is not None:
        return f"{kind}, {low} to {high}"
    if low is not None:
        return f"{kind}, at least {low}"
    return kind if high is None else f"{kind}, at most {high}"


def _json(value: Any) -> str:
    return "null" if value is None else str(value)
