"""Profiles: requests to a policy behind a server, as data (TOML).

A profile names the protocol, the conversion of the observation to the request, and the place of the actions
in the reply and their conversion. The profiles of this package lie in ``profiles/``. ``"?"`` stands for a
value that could not be established: such a profile is refused until another one that ``extends`` it gives the
value.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pytest_libero_max.errors import AdapterError, did_you_mean

UNKNOWN = "?"
"""A value that could not be established."""

FOLDER = Path(__file__).parent / "profiles"

SECTIONS: Mapping[str, tuple[str, ...]] = {
    "policy": (
        "name",
        "protocol",
        "horizon",
        "query_interval",
        "image_size",
        "repeatable",
        "revision",
        "path",
        "codec",
        "dialect",
        "declared_by_server",
        "every_step",
        "suites",
    ),
    "inputs": (),
    "instruction": ("steps",),
    "request": (),
    "reply": ("at", "parts", "normalised_at"),
    "actions": ("control", "steps", "statistics", "statistics_key", "statistics_rule", "normalised_steps"),
    "native": (
        "horizon",
        "query_interval",
        "wait_steps",
        "budgets",
        "episodes",
        "seed",
        "weights",
        "runtime",
    ),
    "sources": (),
}
"""The tables of a profile with their fields. Tables without fields here take any."""

GIVEN_BY_OPTION = {
    "policy.horizon": "--libero-max-horizon",
    "policy.query_interval": "--libero-max-query-interval",
}

Table = Mapping[str, Any]


@dataclass(frozen=True)
class Profile:
    """A profile as read, including everything that it extends.

    Attributes:
        name: Of the file, without its ending.
        tables: The tables of :data:`SECTIONS`.
        folder: Folder in which the files that it names are looked for.
    """

    name: str
    tables: Mapping[str, Table]
    folder: Path

    def get(self, section: str, field: str, default: Any = None) -> Any:
        """Return a field; ``default`` where the profile does not have it."""
        return self.tables.get(section, {}).get(field, default)

    @property
    def protocol(self) -> str:
        """The protocol that it is for."""
        return str(self.get("policy", "protocol"))

    @property
    def digest(self) -> str:
        """SHA-256 of its content, hexadecimal, without ``native`` and ``sources``."""
        said = {name: table for name, table in self.tables.items() if name not in ("sources", "native")}
        return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()

    def unknown(self) -> tuple[str, ...]:
        """Return the fields that could not be established, for example ``policy.horizon``."""
        played = {name: table for name, table in self.tables.items() if name not in ("sources", "native")}
        return tuple(name for name, value in leaves(played) if value == UNKNOWN)

    def require_known(self, given: tuple[str, ...] = ()) -> None:
        """Refuse a profile with a field that could not be established.

        Args:
            given: Fields that are given in another way.

        Raises:
            AdapterError: There is one; says how to give it.
        """
        missing = [name for name in self.unknown() if name not in given]
        if missing:
            options = [f"{GIVEN_BY_OPTION[name]}=..." for name in missing if name in GIVEN_BY_OPTION]
            hint = f" or give {' and '.join(options)}" if options else ""
            raise AdapterError(
                f"Profile {self.name!r} does not know {', '.join(missing)}: nothing that could be read says "
                f'so. Write a file with `extends = "{self.name}"` and these fields, and name it with '
                f"--libero-max-profile{hint}."
            )


def profile_names() -> tuple[str, ...]:
    """Return the profiles of this package, sorted."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load_profile(text: str) -> Profile:
    """Read a profile.

    Args:
        text: The name of one of this package, or the path of a file that ends in ``.toml``.

    Raises:
        AdapterError: There is none, or it cannot be read; names the field and suggests the closest.
    """
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
        found = path.is_file()
    except OSError:  # the name is too long to be one
        found = False
    if not found:
        hint = (
            "Check the path."
            if text.endswith(".toml")
            else f"{did_you_mean(text, profile_names())} A file of your own ends in .toml."
        )
        raise AdapterError.seen("profile", text, f": there is no such profile. {hint}")
    path = path.resolve()
    if path in above:
        raise AdapterError.seen("profile", text, " extends itself. Let it extend a profile of this package.")
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
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
    for field in ("name", "protocol"):
        if not isinstance(tables.get("policy", {}).get(field), str):
            raise AdapterError.seen(
                "profile", text, f" lacks policy.{field}. Add it, or extend a profile that has it."
            )
    return Profile(path.stem, tables, folder)


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
        for field in table:
            if known and field not in known:
                raise AdapterError(
                    f"{path.name}: {section}.{field} is unknown. {did_you_mean(field, known)}",
                    field=f"{section}.{field}",
                    value=table[field],
                    path=path,
                )


def _merged(below: Mapping[str, Table], above: Mapping[str, Table]) -> dict[str, Table]:
    """``below`` with the values of ``above``; an input, a list and a request are replaced as a whole."""
    merged: dict[str, Table] = dict(below)
    for section, table in above.items():
        merged[section] = dict(table) if section == "request" else {**below.get(section, {}), **table}
    return merged
