"""The first page of the reference: what is where, and what writes it."""

from __future__ import annotations

from pathlib import Path

from tests.reference import COMMAND, PAGES
from tests.reference.markdown import table

CONTENT = {
    "options": "Options of pytest with their ini keys; fixtures, hooks, outcome letters, exit statuses",
    "commands": "Every command of `libero-max` with its arguments",
    "gates": "The language of gates, and every quantity that a gate can ask for",
    "causes": "Causes of failed rollouts",
    "events": "The eight events with their numbers, triggers, and programs",
    "records": "Every field of `pairs.jsonl`",
    "report": "Every field of `report.json` and of a comparison",
    "probes": "Columns of probes and what they cost; monitors",
    "rules": "Rules that policies, servers and worlds must keep, and every field of `conformance.json`",
    "worlds": "Observations, actions, budgets, constants of the protocol",
    "api": "The public names of the Python package, and its entry points",
    "glossary": "The words of this project",
}
"""Content of each page, by its name, in the order of the navigation."""


def page() -> str:
    """The text."""
    listed = {Path(path).stem for path in PAGES} - {"index"}
    assert listed <= {*CONTENT}
    rows = ((f"[{name}]({name}.md)", text) for name, text in CONTENT.items())
    return f"""# Reference

`{COMMAND}` writes these pages from the code. A test fails where a page is not what the code says.

{table(("Page", "Content"), rows)}
"""
