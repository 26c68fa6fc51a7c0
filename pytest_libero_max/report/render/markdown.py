"""Documents as Markdown, for a repository or a pull request."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.report.document import Code, Document, Link, Section, Strong, Table
from pytest_libero_max.report.statements import CAVEATS_TITLE, LIMITS_TITLE


def markdown_text(text: object) -> str:
    """Return text as one line that holds no markup of HTML, and no link but those of the document."""
    words = printable(str(text))
    if isinstance(text, Code):
        return f"`{words.replace('`', chr(39))}`"
    words = words.replace("&", "&amp;").replace("<", "&lt;").replace("](", "]\\(")
    if isinstance(text, Link):
        return f"[{words}]({text.address})"
    return f"**{words}**" if isinstance(text, Strong) else words


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table."""
    body = [" | ".join(markdown_text(cell).replace("|", "\\|") for cell in row) for row in (head, *rows)]
    return [f"| {body[0]} |", "|" + " --- |" * len(head), *(f"| {row} |" for row in body[1:])]


def markdown_list(texts: Iterable[str]) -> list[str]:
    """Return the lines of a list."""
    return [f"- {markdown_text(text)}" for text in texts]


def table_markdown(table: Table, level: int = 2) -> str:
    """Return a table with its title and its note, without a line end."""
    parts = [f"{'#' * level} {markdown_text(table.title)}"] if table.title else []
    parts.append("\n".join(markdown_table(table.headings(), table.texts())))
    note = markdown_text(table.note).replace("*", "\\*")
    return "\n\n".join([*parts, *([note] if note else [])])


def section_markdown(section: Section) -> str:
    """Return a section, without a line end."""
    parts = [f"## {markdown_text(section.title)}"] if section.title else []
    parts += [markdown_text(section.lead)] if section.lead else []
    parts += [table_markdown(table, 3 if section.title else 2) for table in section.tables]
    parts += map(markdown_text, section.texts)
    return "\n\n".join([*parts, *(["\n".join(markdown_list(section.items))] if section.items else [])])


def _has_words(section: Section) -> bool:
    """Return True for a section that is more than its plots."""
    return bool(section.tables or section.texts or section.items or (section.lead and not section.plots))


def document_markdown(document: Document, figures: Mapping[str, str] | None = None) -> str:
    """Return a document as the content of a file."""
    parts = [f"# {markdown_text(document.title)}"]
    parts += [f"**{markdown_text(text)}**" for text in document.warnings]
    parts += map(markdown_text, document.texts)
    parts += [section_markdown(part) for part in document.sections if _has_words(part)]
    parts += [f"![{caption}]({stem}.svg)\n\n{caption}" for stem, caption in (figures or {}).items()]
    lists = {CAVEATS_TITLE: document.caveats, LIMITS_TITLE: document.statements}
    parts += [f"## {title}\n\n" + "\n".join(markdown_list(texts)) for title, texts in lists.items() if texts]
    return "\n\n".join(parts) + "\n"
