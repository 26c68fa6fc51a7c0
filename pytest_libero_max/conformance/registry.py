"""The rules: those of this package, and those of other packages."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping

from pytest_libero_max.conformance.rules import Rule
from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry, given

_MODULES = (
    "policy.contract",
    "policy.actions",
    "policy.determinism",
    "policy.inputs",
    "server.contract",
    "server.clients",
    "loop.episodes",
    "loop.actions",
    "substrate.contract",
    "substrate.states",
    "environment.contract",
    "environment.starts",
    "environment.images",
    "environment.actions",
)


def _own() -> Mapping[str, Callable[[], object]]:
    from pytest_libero_max.conformance.substrate.states import EVENT_RULES

    modules = (importlib.import_module(f"{__package__}.{name}") for name in _MODULES)
    values = [value for module in modules for value in vars(module).values()]
    return given("id", *(value for value in values if isinstance(value, Rule)), *EVENT_RULES)()


def _accept(name: str, value: object) -> Rule:
    if not isinstance(value, Rule):
        raise ValueError("it is no Rule; write a function that yields findings below @rule(id, level)")
    return value


RULES: Registry[Rule] = Registry(
    "rule", "pytest_libero_max.rules", _own, _accept, OptionError, attribute="id"
)


def rules_for(kind: str) -> tuple[Rule, ...]:
    """Return the rules for subjects of a kind, in the order in which they are examined."""
    return tuple(RULES[id] for id in RULES if id.partition("/")[0] == kind)
