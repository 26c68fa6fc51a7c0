"""Arguments of a gate against another run: ``(RUN, allow=strength+latency, first=pass)``."""

from __future__ import annotations

import re
from typing import NamedTuple

from pytest_libero_max.errors import OptionError
from pytest_libero_max.runs.comparability import require_names

_ARGUMENT = re.compile(r"""(?:[^,'"]|'[^']*'|"[^"]*")+""")
_NAMED = re.compile(r"(?P<name>[a-z]\w*)\s*=\s*(?P<value>\S*)")
_FORM = "Write allow=SETTING, allow=SETTING+SETTING or first=pass behind the folder of the run."


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
            raise refused(gate, f" has the unknown argument {part!r}. {_FORM}")
    for name, values in named.items():
        if name not in ("allow", "first") or (name == "first" and values != ["pass"]):
            raise refused(gate, f" has the unknown argument {name}={'+'.join(values)}. {_FORM}")
    allow = tuple(named.get("allow", ()))
    try:
        require_names(allow)
    except OptionError as error:
        raise refused(gate, f": allow={'+'.join(allow)}: {error}") from None
    return RunArguments(run.strip("'\""), margin, allow, "first" in named)
