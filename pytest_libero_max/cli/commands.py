"""The places of commands: those of this folder, and those that installed packages add.

An entry point of the group ``pytest_libero_max.commands`` names a module with a function ``add_command``,
like those of this folder::

    [project.entry-points."pytest_libero_max.commands"]
    weather = "my_package.weather"
    "lab.climate" = "my_package.climate"

The second is the command ``climate`` of ``lab``. A module is imported when its command is given, or when
a help lists it.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from importlib import import_module
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, TypeAlias

from pytest_libero_max.errors import OptionError, did_you_mean
from pytest_libero_max.registry import Registry

Add: TypeAlias = Callable[["CommandPlace"], None]

GROUPS = {
    "Start here": ("init", "doctor", "check", "list"),
    "Before a run": ("plan", "serve", "shards"),
    "During and after runs": (
        "runs",
        "view",
        "report",
        "compare",
        "gate",
        "film",
        "publish",
    ),
}
"""The commands of this package by what they are for, in the order of the help."""

_PARTS = {
    "list": (
        "What there is",
        dict.fromkeys(("tracks", "cases", "events", "programs", "profiles", "published", "words"), "lists"),
    ),
    "plan": ("What a run takes and what it can show", {"pairs": "power", "gates": "power"}),
    "shards": ("A run in several parts, on several machines", {"slurm": "slurm", "merge": "merge"}),
    "publish": ("Results for others", {"pack": "publish", "verify": "publish"}),
}
"""The commands of this package that hold others: what these have in common, and the module of each."""


def _own() -> Mapping[str, Callable[[], object]]:
    loaders: dict[str, Callable[[], object]] = {}
    for name in (name for names in GROUPS.values() for name in names):
        help, parts = _PARTS.get(name, ("", {"": name}))
        if help:
            add = partial(CommandPlace.add_group, name=name, help=help)
            loaders[name] = partial(SimpleNamespace, add_command=add)
        modules = {f"{name}.{part}".rstrip("."): module for part, module in parts.items()}
        loaders |= {
            place: partial(import_module, f"{__package__}.{module}") for place, module in modules.items()
        }
    return loaders


def _accept(name: str, module: object) -> Add:
    add: Any = getattr(module, "add_command", None)
    if not callable(add):
        raise ValueError("an entry point of a command is a module with a function add_command")
    return partial(_add_safely, name, add)


def _add_safely(name: str, add: Add, place: CommandPlace) -> None:
    """Add the command of another package, whose function may raise anything."""
    try:
        add(place)
    except Exception as error:
        raise OptionError(
            f"The command {name!r} cannot be used: add_command raised {type(error).__name__}: {error}. "
            "Repair the package that adds it or uninstall it."
        ) from error


if TYPE_CHECKING:
    _Action = argparse._SubParsersAction[argparse.ArgumentParser]
else:  # it is generic for type checkers alone
    _Action = argparse._SubParsersAction


def registry() -> Registry[Add]:
    """Return the functions that add commands; nothing is imported."""
    return Registry("command", "pytest_libero_max.commands", _own, _accept, OptionError)


COMMANDS = registry()
"""Functions that add commands, by the name of the command; a dot stands for the space in ``lab bisect``."""


class CommandPlace(_Action):
    """The place of the parser that commands are added to; each is added when it is asked for.

    Attributes:
        prefix: Beginning of the names in :data:`COMMANDS` of the commands that belong here, up to a dot.
    """

    prefix = ""

    def add_parser(self, name: str, **how: Any) -> argparse.ArgumentParser:
        """Add a command, whose own help begins with its line in the list."""
        line = " ".join(how.setdefault("help", "").split())
        how["description"] = f"{line}. {how.get('description') or ''}".strip()
        return super().add_parser(name, **how)

    def waiting(self) -> tuple[str, ...]:
        """Return the names of the commands that belong here and are not added yet."""
        names = (name.removeprefix(self.prefix) for name in COMMANDS if name.startswith(self.prefix))
        return tuple(name for name in names if "." not in name and name not in self.choices)

    def names(self) -> tuple[str, ...]:
        """Return the names of all commands here."""
        return (*self.choices, *self.waiting())

    def hint(self, name: str) -> str:
        """Return the group of a command that does not belong here, or the name that was probably meant."""
        grouped = [key.replace(".", " ") for key in COMMANDS if key.endswith(f".{name}")]
        if grouped and not self.prefix:
            return f"It is libero-max {grouped[0]}."
        return did_you_mean(name, self.names())

    def require(self, name: str) -> None:
        """Add a command if it belongs here, or raise OptionError."""
        if name not in self.waiting():
            return
        COMMANDS[f"{self.prefix}{name}"](self)
        if name not in self.choices:
            raise OptionError(
                f"The command {self.prefix}{name} cannot be used: its add_command adds no command {name!r}. "
                "Rename the entry point or the command."
            )

    def require_all(self) -> None:
        """Add all commands; one that cannot be used says so in its help."""
        for name in self.waiting():
            try:
                self.require(name)
            except OptionError as error:
                self.add_parser(name, help=str(error).rstrip(".").replace("%", "%%"))

    def add_group(self, name: str, help: str) -> None:
        """Add a command that holds the commands whose entry points begin with its name and a dot."""
        begin = f"{self.prefix}{name}."
        names = [key.removeprefix(begin) for key in COMMANDS if key.startswith(begin)]
        group = self.add_parser(
            name,
            help=f"{help}: {', '.join(names)}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            usage=f"{self._prog_prefix} {name} [-h] COMMAND ...",
        )
        group.description = textwrap.fill(group.description or "", 79)
        place = add_place(group)
        place.prefix = begin

    def listed(self, names: Iterable[str] | None = None) -> Iterator[tuple[str, str]]:
        """Yield commands with their help."""
        helps = {str(choice.dest): " ".join((choice.help or "").split()) for choice in self._choices_actions}
        return ((name, helps[name]) for name in (self.choices if names is None else names))


def add_place(parser: argparse.ArgumentParser) -> CommandPlace:
    """Add a place for commands to a parser."""
    place: Any = parser.add_subparsers(
        action=CommandPlace, required=True, prog=parser.prog, metavar="COMMAND", help=argparse.SUPPRESS
    )
    assert isinstance(place, CommandPlace)
    return place
