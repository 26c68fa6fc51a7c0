"""What the fields of a stored record may hold, checked by hand: a track has thousands of records."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError, did_you_mean

LARGEST = 2**63 - 1
"""No count or seed is larger, so that all of them fit into NumPy's integers."""

_is_sha256 = re.compile("[0-9a-f]{64}").fullmatch
_is_hexadecimal = re.compile("[0-9a-f]+").fullmatch
_is_arm_name = re.compile("[a-z][a-z0-9_]*").fullmatch

_PLAIN = (str, int, bool, type(None))

_REPR = reprlib.Repr()
_REPR.maxstring = _REPR.maxother = 120


@dataclass(frozen=True)
class Rule:
    """What a field may hold.

    Attributes:
        words: The rule for an error message, after "must be".
        holds: Whether a value keeps it.
    """

    words: str
    holds: Callable[[Any], bool]

    @property
    def or_null(self) -> Rule:
        """The same rule, or null."""
        holds = self.holds
        return Rule(f"{self.words}, or null", lambda value: value is None or holds(value))


def one_of(*values: object) -> Rule:
    """One of a few values; 1, 1.0 and true are different ones."""
    words = " or ".join("null" if value is None else repr(value) for value in values)
    known = {(type(value), value) for value in values}
    return Rule(words, lambda value: type(value) in _PLAIN and (type(value), value) in known)


def listed(words: str, holds: Callable[[Any], bool]) -> Rule:
    """A list, or a tuple as dataclasses hold them, of which every item keeps a rule."""
    return Rule(f"a list of {words}", lambda value: type(value) in (list, tuple) and all(map(holds, value)))


def _is_entry(value: Any) -> bool:
    """Whether this is an entry of a schedule, as ``Entry.to_dict`` writes it."""
    if type(value) is not dict or not _named(value.get("trigger"), "type"):
        return False
    if value.keys() == {"trigger", "change"}:
        return _named(value["change"], "operation")
    return value.keys() == {"trigger", "reverts"} and COUNT.holds(value["reverts"])


def _named(value: Any, key: str) -> bool:
    return type(value) is dict and type(value.get(key)) is str


def _is_arms(value: Any) -> bool:
    return type(value) is dict and len(value) > 0 and all(map(_is_arm_name, value))


def _is_policy(value: Any) -> bool:
    return (
        type(value) is dict
        and TEXT.holds(value.get("name"))
        and POSITIVE.holds(value.get("horizon"))
        and POSITIVE.holds(value.get("query_interval"))
        and value["query_interval"] <= value["horizon"]
        and type(value.get("privileged")) is bool
    )


def _is_texts(value: Any) -> bool:
    return type(value) is dict and all(type(text) is str for text in value.values())


def _is_distance(value: Any) -> bool:
    return type(value) in (float, int) and 0 <= value <= LARGEST and isfinite(value)


def _is_counts(value: Any) -> bool:
    return type(value) is dict and all(map(COUNT.holds, value.values()))


FLAG = Rule("true or false", lambda value: type(value) is bool)
TEXT = Rule("text that is not empty", lambda value: type(value) is str and value != "")
ANY_TEXT = Rule("text", lambda value: type(value) is str)
COUNT = Rule("an integer of at least 0", lambda value: type(value) is int and 0 <= value <= LARGEST)
POSITIVE = Rule("an integer of at least 1", lambda value: type(value) is int and 1 <= value <= LARGEST)
DISTANCE = Rule("a number of at least 0", _is_distance)
SHARE = Rule("a number from 0 to 1", lambda value: _is_distance(value) and value <= 1)
SHA256 = Rule("64 hexadecimal digits", lambda value: type(value) is str and _is_sha256(value) is not None)
PROOF = Rule("hexadecimal digits", lambda value: type(value) is str and _is_hexadecimal(value) is not None)
COUNTS = Rule("an object of integers of at least 0", _is_counts)
TEXTS = listed("texts", ANY_TEXT.holds)
OBJECT = Rule("an object", lambda value: type(value) is dict)
NAMED_TEXTS = Rule("an object of texts", _is_texts)
SCHEDULE = listed("entries with a trigger, and a change or a reversal", _is_entry)
ARMS = Rule("an object with at least one arm, by lower-case names", _is_arms)
POLICY = Rule("a policy's spec with name, horizon, query_interval (Q <= H) and privileged", _is_policy)


def check_fields(values: Any, rules: Mapping[str, Rule], what: str) -> Json:
    """Check that a stored object has exactly these fields, and that each keeps its rule.

    Args:
        values: The object as read.
        rules: By field.
        what: How to name it in an error.

    Returns:
        The object.

    Raises:
        ReportError: It is no object, a field is missing or unknown, or a value breaks its rule.
    """
    if type(values) is not dict:
        raise ReportError(f"The {what} must be an object, but this is {shown(values)}.")
    if values.keys() != rules.keys():
        _raise_names(values, rules, what)
    for name, rule in rules.items():
        if not rule.holds(values[name]):
            raise ReportError(f"{name}={shown(values[name])} of the {what}, but must be {rule.words}.")
    return values


def _raise_names(values: Json, known: Iterable[str], what: str) -> None:
    names = set(known)
    for key in values:
        if key not in names:
            raise ReportError(f"The {what} has the unknown field {shown(key)}. {did_you_mean(key, names)}")
    missing = ", ".join(sorted(names - values.keys()))
    raise ReportError(f"{what.capitalize()} {shown(values.get('case_id'))} lacks {missing}.")


def shown(value: object) -> str:
    """A value in an error message, shortened."""
    return _REPR.repr(value)
