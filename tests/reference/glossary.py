"""The page of the words of this project."""

from __future__ import annotations

import tomllib

from pytest_libero_max.report.page.words import GLOSSARY
from tests.reference.markdown import table


def page() -> str:
    """The text."""
    meanings: dict[str, str] = tomllib.loads(GLOSSARY.read_text(encoding="utf-8"))
    return f"""# Glossary

`libero-max list words` prints these, and `libero-max list words WORD` one of them.

{table(("Word", "Meaning"), ((f"**{word}**", text) for word, text in meanings.items()))}
"""
