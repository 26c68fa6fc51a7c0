"""Command-line options and their ini twins, which declare and fill the settings of a run.

Precedence, for every option: command line, then ini file, then default.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import pytest

from pytest_libero_max.errors import LiberoMaxError, did_you_mean
from pytest_libero_max.evaluation import resolving
from pytest_libero_max.evaluation.resolving import path_from
from pytest_libero_max.evaluation.settings import GONE, OPTIONS, Settings
from pytest_libero_max.runs.protocol import RECORDED_RUN
from pytest_libero_max.runs.replay_command import Places
from pytest_libero_max.runs.setting import Group, Option

POLICY_FLAG = "--libero-max-policy"

_GROUPS: dict[Group, str] = {
    "everyday": "LIBERO-MAX: paired evaluation of robot policies under mid-execution events",
    "protocol": "LIBERO-MAX, protocol: what may change a result",
    "machines": "LIBERO-MAX, machines: processes, limits, installations, parts of a run",
}
"""Title of each group of the help."""

_OPTION_OF = {option.key: option for option in OPTIONS}


@contextmanager
def usage_errors(begin: str = "") -> Iterator[None]:
    """Turn an error of this package in the block into a usage error, whose message begins with ``begin``."""
    try:
        yield
    except LiberoMaxError as error:
        raise pytest.UsageError(f"{begin}{error}") from None


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare every option and its ini twin."""
    for option in sorted(OPTIONS, key=lambda option: [*_GROUPS].index(option.group)):
        group = parser.getgroup(f"libero-max {option.group}", _GROUPS[option.group])
        default = f" (default: {option.default})" if option.default else ""
        how: dict[str, Any] = {"metavar": option.metavar, "action": "append" if option.many else "store"}
        if option.switch:
            how = {"action": "store_true"}
        group.addoption(option.flag, dest=option.key, default=None, help=option.help + default, **how)
        kind: Literal["linelist", "string", "bool"] = "linelist" if option.many else "string"
        if option.switch:
            kind = "bool"
        parser.addini(option.key, f"See {option.flag}", kind, default=None)

    for name in GONE:
        group.addoption(
            f"--libero-max-{name}", dest=_gone(name), nargs="?", const=True, help=argparse.SUPPRESS
        )


def _gone(name: str) -> str:
    return f"libero_max_{name.replace('-', '_')}"


def resolve(config: pytest.Config) -> Settings:
    """Return settings from the command line and the ini file, or raise pytest.UsageError."""
    values = {option.field: _value(config, option) for option in OPTIONS}
    given = {option.field for option in OPTIONS if config.getoption(option.key) is not None}
    with usage_errors():
        settings = resolving.resolve(values, config.invocation_params.dir, given)
    # Workers are given the options: what is chosen by this machine's files and environment is kept in them.
    if values["output"] == "auto":
        config.option.libero_max_output = str(settings.output)
    if settings.latency.drawn:  # the folder of a recorded run may be missing where a worker is
        config.option.libero_max_latency = str(settings.latency)
    if settings.shard is not None:
        config.option.libero_max_shard = "{}/{}".format(*settings.shard)
    return settings


def places_of(config: pytest.Config, settings: Settings) -> Places:
    """Return what a session needs of this machine to play pairs of this one again, in another folder."""
    from pytest_libero_max.policies.references import absolute_reference

    folder, option = config.invocation_params.dir, config.option
    profile = settings.profile
    arguments = [f"--rootdir={config.rootpath}", "-p", "pytest_libero_max.plugin.fresh_folder"]
    arguments += [] if config.inipath is None else ["-c", str(config.inipath)]
    arguments += [word for text in option.override_ini or () for word in ("-o", text)]
    arguments += [word for name in option.plugins or () for word in ("-p", name)]
    return Places(
        absolute_reference(settings.reference, folder),
        str(path_from(folder, profile)) if profile is not None and profile.endswith(".toml") else profile,
        None if settings.manifest is None else str(settings.manifest.absolute()),
        None,
        None if settings.study is None else settings.study.seen_from_elsewhere(folder),
        tuple(map(str, settings.libero)),
        None if settings.libero_assets is None else str(settings.libero_assets),
        tuple(arguments),
    )


def given(config: pytest.Config, name: str) -> bool:
    """Return True if an option is given on the command line or in the ini file."""
    key = f"libero_max_{name}"
    return bool(config.getoption(key, None) or ini_value(config, key))


def require_known_keys(config: pytest.Config) -> None:
    """Check options of before, and the keys of ini file and ``-o`` that look like ours: pytest only warns."""
    known = {option.key for option in OPTIONS}
    gone = {_gone(name): f"It is spelled --libero-max-{instead}." for name, instead in GONE.items()}
    for name in GONE:
        if config.getoption(_gone(name)) is not None:
            raise pytest.UsageError(f"--libero-max-{name}: unknown. {gone[_gone(name)]}")
    overridden = (text.partition("=")[0].strip() for text in config.option.override_ini or ())
    for key in (*in_file(config), *overridden):
        ours = key.lower().replace("-", "_")
        if ours.startswith("libero_max") and key not in known:
            raise pytest.UsageError(
                f"ini option {key}: unknown. {gone.get(ours) or did_you_mean(ours, known)}"
            )


def in_order(config: pytest.Config) -> bool:
    """Return True if pairs are to be handed out one by one, see :attr:`Settings.in_order`; known at once."""
    values = {option.name: _value(config, option) for option in OPTIONS if option.name in ("order", "stop")}
    return values["stop"] is not None or bool(values["order"] and values["order"].seed is not None)


def policy_on_command_line(config: pytest.Config) -> bool:
    """Return True if the policy is named on the command line, which alone asks for the pairs."""
    return config.getoption("libero_max_policy") is not None


def on_command_line(config: pytest.Config) -> str:
    """Return the first of our options on the command line, as it is spelled there; empty without one."""
    given = (option.flag for option in OPTIONS if config.getoption(option.key) is not None)
    return next(given, "")


def policy_in_ini_file(config: pytest.Config) -> bool:
    """Return True if the policy is named in the ini file, which asks for the pairs only where collected."""
    return bool(ini_value(config, "libero_max_policy"))


def _value(config: pytest.Config, option: Option) -> Any:
    text, where = config.getoption(option.key), option.flag
    if text is None:
        text, where = ini_value(config, option.key), f"ini option {option.key}"
        if option.key in _OF_FILES and text:
            text = _beside_ini_file(config, text)
    if option.switch:
        return bool(text)
    if text is None or (option.many and not text):
        return option.default
    with usage_errors():
        if option.many:
            return tuple(option.read(line, where) for line in text)
        return option.read(str(text), where)


_OF_FILES = (
    "libero_max_policy",
    "libero_max_profile",
    "libero_max_manifest",
    "libero_max_program",
    "libero_max_latency",
    "libero_max_study",
)
"""Options whose value may be a file, or the folder of a run; from the ini file it is one beside that file."""


def _beside_ini_file(config: pytest.Config, text: str) -> str:
    """Return a value with the path from the working directory, if it names a file beside the ini file."""
    if config.inipath is None:
        return text
    if text.startswith(RECORDED_RUN):
        run = config.inipath.parent / Path(text.removeprefix(RECORDED_RUN)).expanduser()
        return f"{RECORDED_RUN}{os.path.relpath(run, config.invocation_params.dir)}"
    for ending in (".py", ".toml", ".json.gz", ".json"):
        begin, _, rest = text.rpartition(ending)
        file = config.inipath.parent / f"{begin}{ending}"
        if file.is_file():
            return f"{os.path.relpath(file, config.invocation_params.dir)}{rest}"
    return text


def gates_from(config: pytest.Config) -> Path:
    """Return the folder from which paths of runs in gates start: that of the ini file for the gates in it."""
    if config.getoption("libero_max_gate") or config.inipath is None:
        return config.invocation_params.dir
    return config.inipath.parent


def ini_value(config: pytest.Config, key: str) -> Any:
    """Return one of our values from the ini file: text, a list of texts, True or False; None if not there."""
    entry = in_file(config).get(key)
    if entry is not None and getattr(entry, "mode", "ini") == "toml":
        return native_value(_OPTION_OF[key], entry.value)
    try:
        return config.getini(key)
    except (ValueError, pytest.UsageError) as error:  # which one depends on pytest's version
        raise pytest.UsageError(f"ini option {key}: {error}; expected true or false") from None


def in_file(config: pytest.Config) -> Mapping[str, Any]:
    """Return the entries of the ini file and of ``-o``, by key."""
    entries: Mapping[str, Any] = (
        config._inicfg if hasattr(config, "_inicfg") else config.inicfg
    )  # until pytest 9
    return entries


def native_value(option: Option, value: object) -> Any:
    """Return a value of a TOML table as another ini file writes it: text, a list of texts, True or False.

    pytest reads there only the one type that is declared, and a limit, a share or a shard is a number in one
    project and text in the next. Where an option's text has parts, a list is several of them and a table has
    them by name: ``{cadence = [2, 4]}`` is ``cadence:2,4``.

    Returns:
        None for an empty list or table.

    Raises:
        pytest.UsageError: It has a type that the option does not have.
    """
    if option.switch:
        if not isinstance(value, bool):
            raise _unexpected(option, value, "true or false")
        return value
    if option.many:
        values = value if isinstance(value, list) else [value]
        lines = [line.strip() for entry in values for line in _single(option, entry).splitlines()]
        return [line for line in lines if line]
    return (_spelled(option, value, ":") or None) if option.has_parts else _single(option, value)


def _spelled(option: Option, value: object, mark: str) -> str:
    """Return the text of a value; ``mark`` stands between name and value, and ``=`` in a table inside."""
    if isinstance(value, list):
        return ",".join(_spelled(option, entry, mark) for entry in value)
    if isinstance(value, dict):
        return ",".join(f"{name}{mark}{_spelled(option, entry, '=')}" for name, entry in value.items())
    return _single(option, value)


def _single(option: Option, value: object) -> str:
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        expected = "text or a number"
        if option.many:
            expected += ", or a list of these"
        if option.has_parts:
            expected = f"text or a number, a list of these or a table of them by name, as in {option.metavar}"
        raise _unexpected(option, value, expected)
    return str(value)


def _unexpected(option: Option, value: object, expected: str) -> pytest.UsageError:
    return pytest.UsageError(f"ini option {option.key}={value!r}: expected {expected}")
