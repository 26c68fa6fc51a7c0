"""Extension of Griffe: docstrings, whose roles are Sphinx's, as the Markdown that mkdocstrings expects."""

from __future__ import annotations

from typing import Any

import griffe

from tests.reference.markdown import prose


class Roles(griffe.Extension):  # type: ignore[misc]
    """Turn the roles of every docstring into code."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of a function, class, module or attribute."""
        if obj.docstring is not None:
            obj.docstring.value = prose(obj.docstring.value)
