"""The few SVG shapes that the figures need. Text in, text out; the same input gives the same bytes."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.report.palette import GAIN, GRID, INK, LOSS, MUTED

FONT = "font-family='system-ui, sans-serif'"


_HEADING = 30
"""Height of the title of a document."""


def document(width: float, height: float, title: str, shapes: list[str]) -> str:
    """Return a standalone SVG document with its title above the shapes."""
    height += _HEADING
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {_n(width)} {_n(height)}' "
        f"width='{_n(width)}' height='{_n(height)}' role='img'>"
        f"<title>{escape(printable(title))}</title>"
        f"{text(12, 20, title, size=14)}<g transform='translate(0 {_HEADING})'>{''.join(shapes)}</g></svg>"
    )


def text(x: float, y: float, words: str, anchor: str = "start", size: float = 12, color: str = INK) -> str:
    """Words whose baseline is at ``y``."""
    return (
        f"<text x='{_n(x)}' y='{_n(y)}' text-anchor='{anchor}' font-size='{_n(size)}' fill='{color}' {FONT}>"
        f"{escape(printable(words))}</text>"
    )


def line(x1: float, y1: float, x2: float, y2: float, color: str = GRID, width: float = 1) -> str:
    """Return a straight line."""
    return (
        f"<line x1='{_n(x1)}' y1='{_n(y1)}' x2='{_n(x2)}' y2='{_n(y2)}' stroke='{color}' "
        f"stroke-width='{_n(width)}'/>"
    )


def labelled_lines(marks: Sequence[tuple[float, str]], top: float, bottom: float) -> list[str]:
    """Return vertical lines from top to bottom at some places, each with its label above."""
    return [
        shape
        for x, words in marks
        for shape in (line(x, top, x, bottom), text(x, top - 10, words, "middle", 11, MUTED))
    ]


def staircase(places: Sequence[tuple[float, float]], color: str, width: float) -> str:
    """Return a line through places that goes across before it goes up or down."""
    (x, y), *later = places
    path = f"M{_n(x)} {_n(y)}" + "".join(f"H{_n(x)}V{_n(y)}" for x, y in later)
    return f"<path d='{path}' fill='none' stroke='{color}' stroke-width='{_n(width)}'/>"


def circle(x: float, y: float, radius: float, fill: str, stroke: str = "none") -> str:
    """Return a disc."""
    place = f"cx='{_n(x)}' cy='{_n(y)}' r='{_n(radius)}'"
    return f"<circle {place} fill='{fill}' stroke='{stroke}' stroke-width='2'/>"


def rectangle(x: float, y: float, width: float, height: float, fill: str) -> str:
    """Return a filled rectangle."""
    return f"<rect x='{_n(x)}' y='{_n(y)}' width='{_n(width)}' height='{_n(height)}' fill='{fill}'/>"


def shade(value: float) -> str:
    """Colour of a change from -1 (loss) over 0 (white) to 1 (gain); full at half of that."""
    end = LOSS if value < 0 else GAIN
    weight = min(1.0, abs(value) * 2)
    channels = (int(end[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(255 + weight * (channel - 255)):02x}" for channel in channels)


def _n(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")
