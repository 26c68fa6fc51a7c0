"""Hook of MkDocs: what pages name outside ``docs`` becomes part of the site, or a link to the repository.

Links in ``docs`` are relative, also those that lead out of it, so that they work in a checkout and on a code
host. Pictures out there are copied into the site. Other links lead to the repository, whose address is in the
environment variable ``LIBERO_MAX_SOURCE_URL`` as for the README of a release; without it, their text stays.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SOURCE = os.environ.get("LIBERO_MAX_SOURCE_URL", "").rstrip("/")
"""The address of the repository, without which links out of the pages are plain text."""

PICTURES = (".png", ".webp", ".svg", ".jpg")

_FENCE = re.compile(r"(^ *```.*?^ *```$)", re.M | re.S)
_LINK = re.compile(r"(?P<picture>!?)\[(?P<label>[^\]]*)\]\((?P<target>[^)\s]+)\)")


def outside(page: Path, target: str) -> Path | None:
    """Return the file outside ``docs`` that a link names; None where it leads elsewhere.

    Args:
        page: The file of the page.
        target: The address in the link.
    """
    if re.match(r"[a-z]+:|#", target):
        return None
    path = Path(os.path.normpath(page.parent / target.partition("#")[0]))
    return None if path.is_relative_to(DOCS) or not path.is_relative_to(ROOT) else path


def rewritten(text: str, page: Path, source: str = SOURCE) -> str:
    """Return a page whose links out of ``docs`` hold on the site.

    Args:
        text: The page's Markdown.
        page: Its file.
        source: Address of the repository; if empty, such links become plain text.
    """

    def replace(match: re.Match[str]) -> str:
        path = outside(page, match["target"])
        if path is None:
            return match[0]
        name = path.relative_to(ROOT).as_posix()
        if match["picture"]:
            return f"![{match['label']}]({os.path.relpath(DOCS / name, page.parent)})"
        if not source:
            return match["label"]
        _, hash, anchor = match["target"].partition("#")
        return f"[{match['label']}]({source}/{'tree' if path.is_dir() else 'blob'}/main/{name}{hash}{anchor})"

    parts = _FENCE.split(text)  # with one group: every second part is code
    return "".join(part if index % 2 else _LINK.sub(replace, part) for index, part in enumerate(parts))


def on_config(config: Any) -> Any:
    """Let the extension of Griffe be imported; show the address of the repository, where it is known."""
    sys.path.append(str(ROOT))  # for roles.py: MkDocs loads hooks by their path
    if SOURCE:
        config.extra["social"] = [{"icon": "fontawesome/brands/git-alt", "link": SOURCE, "name": "Source"}]
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pictures that pages show from outside ``docs``."""
    from mkdocs.structure.files import File

    added: set[str] = set()
    for file in files.documentation_pages():
        page = Path(file.abs_src_path)
        for match in _LINK.finditer(page.read_text(encoding="utf-8")):
            path = outside(page, match["target"]) if match["picture"] else None
            if path is not None and path.suffix in PICTURES:
                added.add(path.relative_to(ROOT).as_posix())
    for name in sorted(added):
        files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Make links out of ``docs`` links that hold on the site."""
    return rewritten(markdown, Path(page.file.abs_src_path))
