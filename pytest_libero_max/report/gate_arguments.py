"""Arguments of a gate against another run: ``(RUN, allow=strength+latency, first=pass)``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from pytest_libero_max.errors import OptionError, did_you_mean
from pytest_libero_max.runs.comparability import require_names

_ARGUMENT = re.compile(r"""(?:[^,'"]|'[^']*'|"[^"]*")+""")
_NAMED = re.compile(r"(?P<name>[a-z]\w*)\s*=\s*(?P<value>\S*)")
_KNOWN = ("allow", "first")


def refused(gate: str, rest: str) -> OptionError:
    """Return the error of a gate that is not in the language, or decides nothing."""
    return OptionError.seen("gate", gate, rest)


class RunArguments(NamedTuple):
    """Arguments of a quantity against another run."""

    run: str
    margin: str | None
    """Number behind it, as written; None where there is none."""
    allow: tuple[str, ...]
    """Names of the settings in which the runs may differ."""
    first: bool
    """True if the gate passes as long as there is no other run."""


def read_arguments(text: str, gate: str) -> RunArguments:
    """Read the arguments between the parentheses of a gate.

    Args:
        text: The arguments. A folder with a comma in its name is written in quotes.

    Raises:
        OptionError: An argument is unknown, or has a value that it cannot have.
    """
    run, *rest = (part.strip() for part in _ARGUMENT.findall(text) or [""])
    named: dict[str, list[str]] = {}
    margin: str | None = None
    for part in rest:
        match = _NAMED.fullmatch(part)
        if match is not None:
            named.setdefault(match["name"], []).extend(match["value"].split("+"))
        elif margin is None and not named:
            margin = part
        else:
            raise refused(gate, f" has the unknown argument {part!r}. {_form()}")
    _check(named, gate)
    return RunArguments(run.strip("'\""), margin, tuple(named.get("allow", ())), "first" in named)


def _check(named: Mapping[str, list[str]], gate: str) -> None:
    for name in named:
        if name not in _KNOWN:
            raise refused(gate, f" has the unknown argument {name!r}. {_form()}")
    if named.get("first", ["pass"]) != ["pass"]:
        raise refused(gate, f" has first={'+'.join(named['first'])}. {_form()}")
    try:
        require_names(named.get("allow", ()))
    except OptionError as error:
        raise refused(gate, f": allow={'+'.join(named['allow'])}: {error}") from None


def _form() -> str:
    known = did_you_mean("", _KNOWN)
    return f"{known} Write allow=SETTING, allow=SETTING+SETTING or first=pass behind the folder of the run."
