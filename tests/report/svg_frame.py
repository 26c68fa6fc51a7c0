"""A check of SVG documents."""

from __future__ import annotations

from xml.etree import ElementTree

SVG = "{http://www.w3.org/2000/svg}"


def parsed_inside(svg: str) -> ElementTree.Element:
    """Return a well-formed document none of whose shapes is outside its frame."""
    root = ElementTree.fromstring(svg)
    _, _, width, height = map(float, root.attrib["viewBox"].split())
    limits = {"x": width, "x1": width, "x2": width, "cx": width, "y": height, "y1": height, "cy": height}
    for shape in root.iter():
        for key, limit in limits.items():
            assert 0 <= float(shape.get(key, 0)) <= limit
    return root
