"""Names of a scene and facts of a goal as sentences say them, and never as BDDL spells them."""

from __future__ import annotations

import re

_HOLDS = {
    "on": "{thing} was on {place}",
    "in": "{thing} was in {place}",
    "open": "{thing} was open",
    "close": "{thing} was closed",
    "turnon": "{thing} was on",
    "turnoff": "{thing} was off",
}
"""Clauses on a fact that held, by LIBERO's predicate."""

_AIMS = {"open": "to open it", "close": "to close it", "turnon": "to turn it on", "turnoff": "to turn it off"}

_SIDES = {"right": "to the right of", "left": "to the left of", "front": "in front of", "back": "behind"}

_PARTS = (
    (r"(?P<entity>\w*cabinet\w*?_\d+)_(?P<part>top|middle|bottom)_region", "the {part} drawer of {entity}"),
    (r"(?P<entity>\w+?_\d+)_top_side", "the top of {entity}"),
    (r"(?P<entity>\w+?_\d+)_(?P<part>back|front|left|right)_contain_region", "the {part} part of {entity}"),
    (r"(?P<entity>\w+?_\d+)(?:_\w+)?", "{entity}"),
    (r"\w*table_(?P<entity>\w+)_(?P<side>right|left|front|back)_region", "the table {side} {entity}"),
    (r"\w*table\w*", "the table"),
)
"""Regions of a goal by the form of their names, and their words."""


def name_in_words(name: str, instruction: str) -> str:
    """Return the longest part of an entity's name in the instruction, the last of those; or all of it.

    Of a region of an entity, ``wooden_cabinet_1_top_side``, the entity is named.
    """
    parts = re.split(r"_\d+(?:_|$)", name)[0].split("_")
    for length in range(len(parts), 0, -1):
        for first in range(len(parts) - length, -1, -1):
            words = " ".join(parts[first : first + length])
            if re.search(rf"\b{re.escape(words)}s?\b", instruction.lower()):
                return words
    return " ".join(parts)


def place_in_words(name: str, instruction: str) -> str:
    """Return an entity, or a region of one or of a table, in words with an article."""
    for form, words in _PARTS:
        if (match := re.fullmatch(form, name)) is not None:
            groups = match.groupdict()
            side = _SIDES.get(groups.get("side", ""), "")
            entity = f"the {name_in_words(groups.get('entity', ''), instruction)}"
            return words.format(entity=entity, part=groups.get("part", ""), side=side)
    return f"the {name_in_words(name, instruction)}"


def fact_in_words(fact: str, instruction: str) -> str:
    """Return a clause that says that a fact of a goal held, for example ``the drawer was open``.

    Args:
        fact: As a record has it: ``in akita_black_bowl_1 white_cabinet_1_bottom_region``.
        instruction: Of the task, whose words are used.
    """
    predicate, *names = fact.split(" ")
    words = [place_in_words(name, instruction) for name in names]
    if predicate not in _HOLDS or not words:
        return f"the goal held for {place_in_words(fact.replace(' ', '_'), instruction)}"
    return _HOLDS[predicate].format(thing=words[0], place=words[-1])


def aim_in_words(fact: str) -> str:
    """Return what a movement was for, for example ``to open it``."""
    return _AIMS.get(fact.partition(" ")[0], "for the goal")
