"""Damage to results files, at random but the same every time."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from typing import Any

VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 7, 2**70, -(2**70), 0.5, -0.5, 1e308, float("nan"), float("inf")),
    *("", "x", "base", "\ud800", "0" * 64, "a/b"),
    *([], [1], [None], ["x"], {}, {"x": 1}, [[]], {"base": {}}),
)


def damaged(content: bytes, seed: int) -> bytes:
    """A file of JSON lines with one thing changed: a value, a name, a line, or some bytes."""
    draw = random.Random(seed)
    lines = content.splitlines()
    if draw.random() < 0.2:
        return _bytes(content, draw)
    number = draw.randrange(len(lines))
    if draw.random() < 0.1:
        other = draw.randrange(len(lines))
        lines[number], lines[other] = lines[other], lines[draw.choice((number, other))]
        return b"\n".join(lines) + b"\n"
    value = json.loads(lines[number])
    _change(value, draw)
    lines[number] = json.dumps(value).encode()
    return b"\n".join(lines) + b"\n"


def _bytes(content: bytes, draw: random.Random) -> bytes:
    place, length = draw.randrange(len(content)), draw.choice((1, 1, 5, 50, 500))
    some = bytes(draw.randrange(256) for _ in range(length))
    noise = draw.choice((b"", some, b"[" * 5000, b"9" * 5000, b"1e999"))
    return content[:place] + noise + content[place + length :]


def _change(document: Any, draw: random.Random) -> None:
    """Change one value or name somewhere, every depth alike."""
    places = list(_places(document))
    deepest = max(len(path) for path in places)
    path = draw.choice([path for path in places if len(path) == draw.randint(1, deepest)] or places)
    for key in path[:-1]:
        document = document[key]
    key, how = path[-1], draw.random()
    if how < 0.2:
        del document[key]
    elif how < 0.3 and isinstance(document, dict):
        document[draw.choice(("", "x", "success", str(key) + "s"))] = document.pop(key)
    elif how < 0.4 and isinstance(document[key], int | float):
        document[key] += draw.choice((-1, 1))
    else:
        document[key] = draw.choice(VALUES)


def _places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from _places(item, (*path, key))
