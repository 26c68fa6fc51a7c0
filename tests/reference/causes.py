"""The page of the causes of failed arms."""

from __future__ import annotations

from pytest_libero_max.report import diagnosis
from tests.reference.docstrings import description
from tests.reference.markdown import code, prose, table


def page() -> str:
    """The text."""
    causes = table(("Cause", "Meaning"), ((code(name), text) for name, text in diagnosis.CAUSES.items()))
    return f"""# Causes

{prose(description(diagnosis))}

{causes}
"""
