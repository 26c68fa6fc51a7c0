"""Subjects by their names on the command line, for example ``policy:expert`` or ``substrate:embedded``."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

from pytest_libero_max.conformance.environment.declared import FactoryName
from pytest_libero_max.conformance.python_name import PythonName
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination
from pytest_libero_max.substrates.registry import chosen_substrate

KINDS = {
    "policy": "a policy, as for --libero-max-policy; the kind of a subject that names none",
    "server": "the address of a policy server, with --libero-max-profile",
    "substrate": "a substrate, as for --libero-max-substrate",
    "env": "the factory of an environment, PACKAGE:FACTORY or FILE.py:FACTORY, with :ARGUMENTS",
    "loop": "the function of an evaluation loop, PACKAGE:FUNCTION or FILE.py:FUNCTION",
}
"""Kinds of subjects, and what follows the colon."""

_OPENERS = {
    "policy": ("policy", "open_policy"),
    "server": ("server", "open_at"),
    "substrate": ("substrate", "open_subject"),
    "env": ("environment", "open_environment"),
    "loop": ("loop", "open_loop"),
}
"""Room of each kind, and the function that opens a subject; imported when one is examined."""


@dataclass(frozen=True)
class Subject:
    """A subject that is not opened yet."""

    kind: str
    name: str

    @classmethod
    def read(cls, text: str) -> Subject:
        """Return the subject of a text, ``KIND:NAME`` or the reference of a policy."""
        kind, colon, name = text.partition(":")
        subject = cls(kind, name.strip()) if colon and kind in KINDS else cls("policy", text.strip())
        if not subject.name:
            raise ValueError(f"expected a policy, or {' or '.join(f'{kind}:NAME' for kind in KINDS)}")
        if subject.kind == "substrate":
            chosen_substrate(subject.name)
        elif subject.kind == "loop":
            PythonName.read(subject.kind, subject.name)
        elif subject.kind == "env":
            FactoryName.read(subject.name)
        return subject

    def __str__(self) -> str:
        return f"{self.kind}:{self.name}"

    def check(self, profile: str | None = None) -> None:
        """Check that there is such a subject, without loading anything."""
        if self.kind == "policy":
            from pytest_libero_max.policies.loading import check_reference

            check_reference(self.name, profile, None)
        elif self.kind == "server":
            from pytest_libero_max.policies.clients.opening import require_profile

            require_profile(self.name, profile)
        elif self.kind == "env":
            FactoryName.read(self.name).place.check()
        elif self.kind == "loop":
            PythonName.read(self.kind, self.name).check()


def examination(
    subject: Subject,
    *,
    horizon: int | None = None,
    query_interval: int | None = None,
    profile: str | None = None,
    substrate: str = "embedded",
) -> Examination:
    """Return the examination of a subject by all rules of its kind; nothing is opened yet."""
    module, name = _OPENERS[subject.kind]
    options = {"horizon": horizon, "query_interval": query_interval, "profile": profile}
    opened_with: dict[str, Any] = {}
    if subject.kind in ("policy", "server"):
        opened_with = options | {"substrate": substrate}
    opener = getattr(import_module(f"{__package__}.{module}.subject"), name)
    return Examination(lambda: opener(subject.name, **opened_with), rules_for(subject.kind))
