"""Profiles: requests to a policy behind a server, as data (TOML).

A profile names the protocol, the conversion of the observation to the request, and the place of the actions
in the reply and their conversion. The profiles of this package lie in ``profiles/``. ``"?"`` stands for a
value that could not be established: such a profile is refused until another one that ``extends`` it gives the
value.
"""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.benchmark.structs import Count, Flag, Positive, Text, Texts, fits, rule, shown, words
from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.worlds.robot import PANDA, ROBOTS, Robot

PROFILE_ALONE = "profile"
"""Begins the revision of a policy whose weights nobody has declared."""

UNKNOWN = "?"
"""A value that could not be established."""

FOLDER = Path(__file__).parent / "profiles"

_TwoSizes = Annotated[tuple[Positive, ...], rule("two integers", min_length=2, max_length=2)]
"""A fixed-length tuple in a union would crash msgspec 0.22."""

_ImageSize = Annotated[
    Positive | _TwoSizes, rule("an integer of at least 1, or two of them, [height, width]")
]
_List = Annotated[list[Any], rule("a list")]
_Budgets = Annotated[dict[str, Positive], rule("a table of integers of at least 1, by suite")]


def _frozen(tables: dict[str, dict[str, Any]]) -> Mapping[str, Mapping[str, Any]]:
    return MappingProxyType({name: MappingProxyType(fields) for name, fields in tables.items()})


SECTIONS: Mapping[str, Mapping[str, Any]] = _frozen(
    {
        "policy": {
            **dict.fromkeys(("name", "protocol", "revision", "path", "codec", "dialect"), Text),
            **dict.fromkeys(("unnorm_key", "robot"), Text),
            **dict.fromkeys(("repeatable", "declared_by_server", "every_step"), Flag),
            "horizon": Positive,
            "query_interval": Positive,
            "image_size": _ImageSize,
            "suites": Texts,
        },
        "inputs": {},
        "instruction": {"steps": _List},
        "request": {},
        "reply": dict.fromkeys(("at", "parts", "normalised_at"), _List),
        "actions": {
            **dict.fromkeys(("control", "statistics", "statistics_key", "statistics_rule"), Text),
            **dict.fromkeys(("steps", "normalised_steps"), _List),
        },
        "native": {
            **dict.fromkeys(("horizon", "query_interval", "episodes"), Positive),
            **dict.fromkeys(("wait_steps", "seed"), Count),
            **dict.fromkeys(("weights", "runtime"), Text),
            "budgets": _Budgets,
        },
        "published": {"row": Text},
        "sources": {},
    }
)
"""Tables of a profile with the types of their fields. Tables without fields here take any."""

_NOT_PLAYED = ("sources", "native", "published")

GIVEN_BY_OPTION = MappingProxyType(
    {
        "policy.horizon": "--libero-max-horizon",
        "policy.query_interval": "--libero-max-query-interval",
    }
)

Table = Mapping[str, Any]


@dataclass(frozen=True)
class Profile:
    """A profile as read, including everything that it extends."""

    path: Path
    tables: Mapping[str, Table]
    """The tables of :data:`SECTIONS`."""
    folder: Path
    """Folder in which its statistics are looked for: that of the profile that names them."""

    @property
    def name(self) -> str:
        """Name of the file, without its ending."""
        return self.path.stem

    def get(self, section: str, field: str, default: Any = None) -> Any:
        """Return a field; ``default`` where the profile does not have it."""
        return self.tables.get(section, {}).get(field, default)

    @property
    def protocol(self) -> str:
        """The protocol that it is for."""
        return str(self.get("policy", "protocol"))

    @property
    def robot(self) -> Robot:
        """The robot whose keys it reads and whose actions it brings; LIBERO's Panda unless it names one."""
        return ROBOTS[self.get("policy", "robot", PANDA.name)]

    @property
    def digest(self) -> str:
        """SHA-256 of its content, hexadecimal, without what is not played."""
        tables = {name: table for name, table in self.tables.items() if name not in _NOT_PLAYED}
        return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()

    @property
    def suites(self) -> tuple[str, ...] | None:
        """The suites that it is for; None for all.

        A server that was started with the statistics of one suite (``policy.unnorm_key``) plays that alone.
        """
        declared = self.get("policy", "suites")
        if declared is not None:
            return tuple(declared)
        suite = suite_of_key(self.get("policy", "unnorm_key") or self.get("actions", "statistics_key"))
        return None if suite is None else (suite,)

    def unknown(self) -> tuple[str, ...]:
        """Return the fields that could not be established, for example ``policy.horizon``."""
        played = {name: table for name, table in self.tables.items() if name not in _NOT_PLAYED}
        return tuple(name for name, value in leaves(played) if value == UNKNOWN)

    def require_known(self, given: tuple[str, ...] = ()) -> None:
        """Refuse a profile with a field that could not be established."""
        missing = [name for name in self.unknown() if name not in given]
        if missing:
            options = [f"{GIVEN_BY_OPTION[name]}=..." for name in missing if name in GIVEN_BY_OPTION]
            hint = f" or give {' and '.join(options)}" if options else ""
            raise AdapterError(
                f"Profile {self.name!r} does not know {', '.join(missing)}: nothing that could be read says "
                f'so. Write a file with `extends = "{self.name}"` and these fields, and name it with '
                f"--libero-max-profile{hint}."
            )


def suite_of_key(key: str | None) -> str | None:
    """Return the suite that a key of normalisation statistics names, for example ``libero_goal_no_noops``.

    None where it names none, or several.
    """
    matches = [] if key is None else re.findall(r"libero_(?:spatial|object|goal|10|90)(?![0-9])", key)
    return matches[0] if len(set(matches)) == 1 else None


def declares_weights(revision: str) -> bool:
    """Return True if a revision says more than by which profiles the servers were asked."""
    return re.search(rf"(?:^|; |: ){PROFILE_ALONE} \S+ [0-9a-f]{{12}}(?:;|$)", revision) is None


def profile_names() -> tuple[str, ...]:
    """Return the profiles of this package, sorted."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load_profile(text: str) -> Profile:
    """Read a profile: one of this package by its name, or a file that ends in ``.toml``."""
    return _load(text, Path(), ())


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Every value inside tables and lists, with its dotted name; entries of a list have the list's."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from leaves(inner, f"{name}.{key}" if name else key)
    elif isinstance(value, list):
        for inner in value:
            yield from leaves(inner, name)
    else:
        yield name, value


def _load(text: str, beside: Path, above: tuple[Path, ...]) -> Profile:
    path = beside / text if text.endswith(".toml") else FOLDER / f"{text}.toml"
    try:
        exists = path.is_file()
    except OSError:  # the name is too long to be one
        exists = False
    if not exists:
        hint = (
            "Check the path."
            if text.endswith(".toml")
            else f"{did_you_mean(text, profile_names())} See `libero-max list profiles`; one of your own "
            "is a file that ends in .toml."
        )
        raise AdapterError.seen("profile", text, f": there is no such profile. {hint}")
    path = path.resolve()
    if path in above:
        raise AdapterError.seen("profile", text, " extends itself. Let it extend a profile of this package.")
    try:
        content = tomllib.loads(read_text(path))
    except (OSError, ValueError, RecursionError) as error:
        raise AdapterError.seen("profile", text, f" cannot be read: {error}. Repair the file.") from None
    extends = content.pop("extends", None)
    _check(content, path)
    tables: Mapping[str, Table] = content
    folder = path.parent
    if extends is not None:
        if not isinstance(extends, str):
            raise AdapterError.seen(
                "profile", text, f": extends={extends!r}, but must be the name of a profile."
            )
        below = _load(extends, path.parent, (*above, path))
        tables = _merged(below.tables, content)
        if "statistics" not in content.get("actions", {}):
            folder = below.folder
    for field in ("name", "protocol"):
        if not isinstance(tables.get("policy", {}).get(field), str):
            raise AdapterError.seen(
                "profile", text, f" lacks policy.{field}. Add it, or extend a profile that has it."
            )
    return Profile(path, tables, folder)


def _check(content: Table, path: Path) -> None:
    for section, table in content.items():
        if section not in SECTIONS or not isinstance(table, dict):
            raise AdapterError(
                f"{path.name}: {section!r} is no table of a profile. {did_you_mean(section, SECTIONS)}",
                field=section,
                value=table,
                path=path,
            )
        known = SECTIONS[section]
        for field, value in table.items() if known else ():
            wrong = f" is unknown. {did_you_mean(field, known)}"
            if field in known:
                if fits(value, known[field]) or any(leaf == UNKNOWN for _, leaf in leaves(value)):
                    continue
                wrong = f"={shown(value)}, but must be {words(known[field])}."
            name = f"{section}.{field}"
            raise AdapterError(f"{path.name}: {name}{wrong}", field=name, value=value, path=path)


def _merged(below: Mapping[str, Table], above: Mapping[str, Table]) -> dict[str, Table]:
    """``below`` with the values of ``above``; an input, a list and a request are replaced as a whole."""
    merged: dict[str, Table] = dict(below)
    for section, table in above.items():
        merged[section] = dict(table) if section == "request" else {**below.get(section, {}), **table}
    return merged
