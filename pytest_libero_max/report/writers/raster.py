"""Figures as PNG, with the extra ``figures``; the lettering is the same on every machine."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path

from pytest_libero_max.errors import install_extra
from pytest_libero_max.report.palette import PAPER

INSTALL = install_extra("figures")

_ZOOM = 2


def available() -> bool:
    """Return True if the drawing library is installed."""
    return all(importlib.util.find_spec(name) for name in ("resvg_py", "PIL"))


def png_of(svg: str) -> bytes:
    """Draw an SVG document at twice its size on white, in the font that comes with Pillow."""
    import resvg_py
    from PIL import ImageFont

    font = ImageFont.load_default(size=12)
    assert isinstance(font, ImageFont.FreeTypeFont)
    family = font.getname()[0] or ""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "font.ttf")
        file.write_bytes(font.font_bytes)
        return bytes(
            resvg_py.svg_to_bytes(
                svg_string=svg,
                font_files=[str(file)],
                skip_system_fonts=True,
                font_family=family,
                sans_serif_family=family,
                background=PAPER,
                zoom=_ZOOM,
            )
        )
