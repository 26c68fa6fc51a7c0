"""What the provenance of a run says of its settings, by the names of the options that set them.

``protocol`` and ``policy`` hold values under these names, so that headers, agreement and replay commands
follow from what is there, and another setting needs no line here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pytest_libero_max.benchmark.documents import Json

_USUAL = ("prefix", "noise_floor", "sham")
"""Parts of a protocol that leave Base and Dynamic as they are."""

_NO_OPTIONS = ("reference", "code", "servers", "profile", "study", "program", "noise_floor")
"""Fields that are no value of an option, or one that depends on other fields."""


def protocol_words(protocol: Json) -> dict[str, str]:
    """Return words for what makes a protocol another one than the usual, by the name of the setting."""
    return {
        name: f"{name.replace('_', ' ')} {_shown(value)}"
        for name, value in protocol.items()
        if name not in _USUAL and value is not None
    }


def option_values(provenance: Json) -> Iterator[tuple[str, object]]:
    """Yield the options that a provenance names with their values."""
    for part in ("protocol", "policy"):
        for name, value in provenance[part].items():
            if name not in _NO_OPTIONS:
                yield name.replace("_", "-"), value


def played_settings(protocol: Json) -> dict[str, str]:
    """Return what each record says of a protocol, among its fingerprints, by the name of the setting.

    Studies and programs are objects: the arms of a record say what they played.
    """
    return {
        name: fingerprint_text(protocol[name])
        for name in protocol_words(protocol)
        if not isinstance(protocol[name], dict)
    }


def fingerprint_text(value: Any) -> str:
    """Return the value of a setting as the fingerprints of a record hold it."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        digest = value.get("digest")
        return str(value["name"]) + (f" ({digest[:12]})" if digest else "")
    return fingerprint_text(value)
