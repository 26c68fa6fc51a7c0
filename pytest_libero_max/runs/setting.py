"""Settings: one field of a dataclass says how a setting is read, and what records say of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import Object
from pytest_libero_max.errors import LiberoMaxError, OptionError

Group = Literal["everyday", "protocol", "machines"]

Part = Literal["protocol", "policy"]
"""Part of a provenance that holds settings."""

ALWAYS: Any = object()
"""In the place of a setting's usual value: every value is recorded."""


@dataclass(frozen=True)
class Recorded:
    """One field of the provenance, in which a setting that may change a result is recorded.

    Header, checks of records against their run, comparisons of runs and replay commands follow from it.
    """

    part: Part
    holds: Any = Any
    value: Callable[[Any], Any] = lambda value: value
    """Returns what the field holds, of the setting's value."""
    usual: Any = None
    """Content that is left out; :data:`ALWAYS` where none is."""
    alters: bool = True
    """True if Base and Dynamic are played in another way than usual: the header names it then, and each
    record among its fingerprints, unless it is an object."""
    kind: Literal["setting", "added", "policy", "place"] | None = None
    """Kind of a difference between runs, see :mod:`.comparability`; None for that of the part."""
    as_played: Callable[[Json, Any], Any] | None = None
    """Returns what the policy's spec says of it, as played, of that and of the field's content; None where it
    says nothing."""
    hides: tuple[str, ...] = ()
    """Fields of a policy's spec that are not those asked for, where this one is."""
    option: Callable[[Any], str] | None = str
    """Returns the text of the option, or its part of a text with commas, of the field's content. None for a
    place, which a replay command takes from where it is on its machine."""
    of_selection: bool = False
    """True if its effect on a pair depends on the other pairs of the run."""

    @property
    def in_fingerprints(self) -> bool:
        """True if each record names it where the header does."""
        return self.part == "protocol" and self.alters and self.holds is not Object


@dataclass(frozen=True)
class Option:
    """One setting: its flag is ``--libero-max-<name>``, its ini key ``libero_max_<name>``."""

    name: str
    metavar: str
    help: str
    parse: Callable[[str], Any]
    """Turns the text into a value; raises ``ValueError`` with the accepted form."""
    default: Any = None
    many: bool = False
    """True if it may be given several times (in the ini file: one a line)."""
    switch: bool = False
    """True for a flag without a value (in the ini file: true or false)."""
    recorded: Recorded | Callable[[], Mapping[str, Recorded]] | None = None
    """The field of the provenance that has its name, or several by name; None for a setting that changes no
    result."""
    session: bool = False
    """True if it is about pytest's session, or about machines that only a session uses."""
    group: Group = "everyday"
    """Group of the help: what one needs every day, what may change a result, and the rest."""

    @property
    def flag(self) -> str:
        return f"--libero-max-{self.name}"

    @property
    def field(self) -> str:
        """Name of the field of the settings."""
        return self.name.replace("-", "_")

    @property
    def key(self) -> str:
        return f"libero_max_{self.field}"

    @property
    def has_parts(self) -> bool:
        """True if its text has parts with commas or colons between, which the metavar shows."""
        return not {*",:"}.isdisjoint(self.metavar)

    @property
    def records(self) -> Mapping[str, Recorded]:
        """The fields of the provenance in which it is recorded, by name."""
        if isinstance(self.recorded, Recorded):
            return {self.field: self.recorded}
        return {} if self.recorded is None else self.recorded()

    def read(self, text: str, where: str) -> Any:
        """Return the value of a text, or raise OptionError."""
        try:
            return self.parse(text)
        except (ValueError, LiberoMaxError) as error:
            value = f"{self.name}={text!r}"  # errors about a gate begin with it, and it is said once
            message = str(error)
            rest = message.removeprefix(value) if message.startswith(value) else f": {message}"
            raise OptionError(f"{where}={text!r}{rest}") from None


def setting(
    metavar: str,
    help: str,
    parse: Callable[[str], Any],
    *,
    default: Any = None,
    many: bool = False,
    recorded: Recorded | Callable[[], Mapping[str, Recorded]] | None = None,
    session: bool = False,
    group: Group = "everyday",
) -> Any:
    """Declare a field of settings; arguments as of :class:`Option`. What is recorded is protocol."""
    default = () if many else default
    group = "protocol" if recorded is not None else group
    declared = {"metavar": metavar, "help": help, "parse": parse, "default": default, "many": many}
    return field(metadata={**declared, "recorded": recorded, "session": session, "group": group})


def switch(help: str, *, session: bool = False, group: Group = "everyday") -> Any:
    """Declare a setting that is on or off, likewise."""
    declared = {"metavar": "", "help": help, "parse": bool, "default": False}
    return field(metadata={**declared, "switch": True, "session": session, "group": group})


def options_of(kind: type[Any]) -> tuple[Option, ...]:
    """Return the options that the fields of a class declare, in their order."""
    return tuple(Option(item.name.replace("_", "-"), **item.metadata) for item in fields(kind))
