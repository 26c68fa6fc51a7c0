"""Examinations of published implementations by the rules of conformance, as one file and one page."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Final, Literal

import msgspec

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.benchmark.structs import Document as Stored
from pytest_libero_max.benchmark.structs import Text, decode, to_builtins
from pytest_libero_max.conformance.results import Conformance, FindingResult, RuleResult
from pytest_libero_max.errors import OptionError
from pytest_libero_max.report.document import Code, Document, Section, Strong, Table
from pytest_libero_max.report.render.markdown import document_markdown

FIELD_VERSION: Final = 1
"""Version of the form of :class:`Field`."""

FIELD_NAME = "conformance.json"


class Field(Stored, frozen=True, kw_only=True):
    """Examinations by the name of the implementation."""

    schema_version: Literal[1] = FIELD_VERSION
    """Version of this document's form."""
    subjects: dict[str, Conformance]
    """Results, in the order of the page."""


class Implementation(Stored, frozen=True, kw_only=True):
    """What is known of an implementation beside its examination."""

    title: Text
    """Package, or part of one."""
    notes: list[Text] = msgspec.field(default_factory=list)
    """How it was installed, and what was put in the place of what is missing."""


class About(Stored, frozen=True, kw_only=True):
    """The texts of the page, from ``about.toml``."""

    title: Text
    lead: list[Text]
    """Paragraphs above the table."""
    method: list[Text]
    """Paragraphs below all results."""
    implementations: dict[str, Implementation]
    """In the order of the page."""
    pictures: dict[str, Text] = msgspec.field(default_factory=dict)
    """Captions of pictures beside the page, by the name of their file."""


def read_about(path: Path) -> About:
    """Read the texts of a page.

    Raises:
        OptionError: The file cannot be read, or has something else in it.
    """
    try:
        return msgspec.convert(tomllib.loads(read_text(path)), About)
    except (OSError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise OptionError(f"{path}: {error}. Write title, lead, method and implementations.") from None


def read_field(text: str) -> Field:
    """Return stored examinations."""
    return decode(text.encode(), Field)


def field_json(field: Field) -> str:
    """Return examinations as they are stored."""
    return json.dumps(to_builtins(field), indent=1, allow_nan=False) + "\n"


def field_page(field: Field, about: About) -> str:
    """Return the page: rules by implementation, then each implementation's broken rules."""
    sections = [Section("Rules by implementation", [_overview(field)], [_LEGEND])]
    sections += [
        _implementation(about.implementations[name], document) for name, document in field.subjects.items()
    ]
    absent = [about.implementations[name] for name in about.implementations if name not in field.subjects]
    if absent:
        items = [f"{each.title}: {' '.join(each.notes)}" for each in absent]
        sections.append(Section("Not examined", items=items))
    sections.append(Section("How it was measured", texts=about.method))
    page = document_markdown(Document(about.title, texts=about.lead, sections=sections))
    pictures = (f"\n![{caption}]({file})\n\n{caption}\n" for file, caption in about.pictures.items())
    return page + "".join(pictures)


_LEGEND = (
    "An empty cell: the rule is kept. A dash: it could not be examined, because the implementation has no "
    "such part, or because a rule that it needs is broken. Where a rule of level must is broken, results "
    "differ from those of LIBERO; should and note are differences to know of."
)


def _overview(field: Field) -> Table:
    rules = {rule.id: rule.level for document in field.subjects.values() for rule in document.rules}
    results = {name: {rule.id: rule for rule in document.rules} for name, document in field.subjects.items()}
    rows = [
        (Code(id.partition("/")[2]), level, *(_cell(by_id.get(id)) for by_id in results.values()))
        for id, level in rules.items()
    ]
    return Table("", ("Rule", "Level", *results), rows)


def _cell(rule: RuleResult | None) -> str:
    if rule is None:
        return "not run"
    if rule.state == "broken":
        return Strong("broken") if rule.level == "must" else "differs"
    return "" if rule.state == "kept" else "-"


def _implementation(about: Implementation, document: Conformance) -> Section:
    versions = ", ".join(f"{name} {version}" for name, version in document.versions.items())
    rows = [*_broken(document)]
    tables = [Table("", ("Rule", "Level", "Observed", "Expected"), rows)] if rows else []
    texts = [f"Versions: {versions}.", *about.notes]
    counts = document.counts
    examined = len(document.rules) - counts["unexamined"]
    lead = f"{counts['kept']} of {examined} rules that could be examined are kept."
    return Section(about.title, tables, texts, lead=lead)


def _broken(document: Conformance) -> Iterator[tuple[str, ...]]:
    for rule in document.rules:
        for finding in rule.findings:
            if finding.state == "broken":
                yield Code(rule.id.partition("/")[2]), rule.level, _observed(finding), finding.expected


def _observed(finding: FindingResult) -> str:
    return f"{finding.part} {finding.observed}".strip()
