"""JSON Schemas: generated from structs, and shown as tables with one row a field."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from inspect import getmembers, isclass
from typing import Any, NamedTuple

import msgspec

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import LARGEST
from pytest_libero_max.conformance import results as conformance_results
from pytest_libero_max.report import report_document
from pytest_libero_max.report.comparison import comparison_document
from pytest_libero_max.report.studies import study_document
from pytest_libero_max.stats import blocks
from tests.reference.docstrings import description, section, summary

_DOCUMENTS = (
    blocks,
    report_document,
    study_document,
    comparison_document,
    conformance_results,
)
"""The modules with the structs of reports and comparisons."""

_COMMON = {"line": "Kind of the line.", "schema_version": "Version of the form of this document."}
"""Descriptions of the fields that no docstring describes."""


def schema_of(kind: Any, title: str, text: str) -> Json:
    """The JSON Schema of documents, with the words of the docstrings of their structs.

    Args:
        kind: A struct, or a union of several.
        title: Of the schema.
        text: Its description.
    """
    schema: Json = _without_levels(msgspec.json.schema(kind))
    definitions = {cls.__name__: cls for cls in _structs(msgspec.inspect.type_info(kind))}
    for name, node in schema["$defs"].items():
        cls = definitions[name]
        node["description"] = json_words(" ".join(description(cls).split()))
        del node["title"]
        texts = {**_COMMON, **section(cls, "Attributes")}
        for key, field in node["properties"].items():
            if key in texts:
                field["description"] = json_words(texts[key])
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, "description": text}
    return head | schema


def _without_levels(node: Any) -> Any:
    """A schema in which an object of no declared fields is one, and not its levels one by one."""
    if isinstance(node, list):
        return [_without_levels(part) for part in node]
    if not isinstance(node, dict):
        return node
    left_out = {"plain", "additionalProperties"} if "plain" in node else set()
    return {key: _without_levels(part) for key, part in node.items() if key not in left_out}


@cache
def written_schema(struct: type[msgspec.Struct]) -> Json:
    """The schema of a document as it is written: every field is there, and described by its docstring."""
    (_,), definitions = msgspec.json.schema_components([struct], ref_template="#/$defs/{name}")
    known = {name: cls for module in _DOCUMENTS for name, cls in getmembers(module, isclass)}
    for name, node in definitions.items():
        _describe(node, known[name])
    root = definitions.pop(struct.__name__)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **root, "$defs": definitions}


def _describe(node: Json, cls: type[Any]) -> None:
    words = {
        name: text for base in reversed(cls.__mro__) for name, text in section(base, "Attributes").items()
    }
    node["description"] = json_words(summary(cls))
    if not cls.__struct_config__.omit_defaults:  # otherwise those without a default alone are always there
        node["required"] = list(node["properties"])
    for name, field in node["properties"].items():
        field.pop("default", None)
        field["description"] = json_words(words[name])


def json_words(text: str) -> str:
    """A docstring's words as JSON has them."""
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", r"\1", text).replace("`", "")
    return re.sub(r"\bNone\b", "null", re.sub(r"\bTrue\b", "true", re.sub(r"\bFalse\b", "false", text)))


def _structs(node: Any) -> Iterator[type]:
    """Every struct in a type."""
    if isinstance(node, msgspec.inspect.StructType):
        yield node.cls
        for field in node.fields:
            yield from _structs(field.type)
    for name in ("type", "key_type", "value_type", "item_type"):
        if hasattr(node, name):
            yield from _structs(getattr(node, name))
    for part in (*getattr(node, "types", ()), *getattr(node, "item_types", ())):
        yield from _structs(part)


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
    for part in (node, *_parts(node)):
        yield from _walk(part, path)


def _parts(node: Json) -> list[Json]:
    """The alternatives of a field."""
    return [*node.get("oneOf", ()), *node.get("anyOf", ())]


def kind_of(node: Json) -> str:
    """What a field holds, in words, for example ``number or null``."""
    if "$ref" in node:
        return str(node["$ref"]).rpartition("/")[2]
    if _parts(node):
        return " or ".join(sorted(map(kind_of, _parts(node)), key=lambda word: word == "null"))
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
    high = None if high == LARGEST else high
    if low is not None and high is not None:
        return f"{kind}, {low} to {high}"
    if low is not None:
        return f"{kind}, at least {low}"
    return kind if high is None else f"{kind}, at most {high}"


def _json(value: Any) -> str:
    return "null" if value is None else str(value)
