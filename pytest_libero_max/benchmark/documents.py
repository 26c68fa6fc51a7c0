"""JSON documents of the benchmark: canonical form, digests, compressed files, and checked fields."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import os
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pytest_libero_max.errors import ManifestError, did_you_mean

Json = dict[str, Any]

MOST_BYTES = 2**31
"""Largest size, bytes, that a packed file may unpack to. A run of 8,000 pairs has some 50 MB."""

_PART = 2**20


def canonical_json(value: Any) -> str:
    """JSON with sorted keys and no spaces; refuses NaN and infinities."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def canonical_digest(value: Any) -> str:
    """SHA-256 of :func:`canonical_json`, hexadecimal."""
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()


def printable(text: str) -> str:
    """Return a line of text in which every control or format character is spelled, for example ``\\x1b``.

    Names come from files of others. On a terminal an escape sequence in one would move the cursor or hide
    text, and a line end would begin a line of its own.
    """
    return text if text.isprintable() else "".join(map(_spelled, text))


def read_content(path: Path) -> bytes:
    """Return the bytes of a file, unpacked where its name ends in ``.gz``.

    Raises:
        OSError: It cannot be read, or is damaged.
    """
    content = path.read_bytes()
    if path.suffix != ".gz":
        return content
    unpacked = io.BytesIO()
    try:
        with gzip.open(io.BytesIO(content)) as file:
            while part := file.read(_PART):
                unpacked.write(part)
                if unpacked.tell() > MOST_BYTES:
                    raise OSError(f"{path} unpacks to more than {MOST_BYTES} bytes, as no document of ours")
    except (EOFError, zlib.error) as error:
        raise OSError(f"{path}: {error}") from error
    return unpacked.getvalue()


def _spelled(letter: str) -> str:
    return letter if letter.isprintable() else letter.encode("unicode_escape").decode()


def refuse_constant(name: str) -> float:
    """Refuse ``NaN`` and ``Infinity``, as ``parse_constant`` of :func:`json.loads`.

    Raises:
        ValueError: Always.
    """
    raise ValueError(f"{name} is not JSON")


def slug(text: str) -> str:
    """Return a name as one word of an id: lower case, underscores for spaces."""
    return text.lower().replace(" ", "_")


def cut_torn_line(path: Path) -> bool:
    """Remove the end of a file of lines after its last line end: a line that a kill cut off.

    Returns:
        True if there was one.

    Raises:
        OSError: The file cannot be read or written.
    """
    content = path.read_bytes()
    whole = content.rfind(b"\n") + 1
    if whole == len(content):
        return False
    os.truncate(path, whole)
    return True


def require_object(value: Any, where: str) -> Json:
    """Return the value as a JSON object.

    Raises:
        ManifestError: It is not one.
    """
    if not isinstance(value, dict):
        raise ManifestError(f"{where} must be a JSON object, not {type(value).__name__}.")
    return value


def require_keys(
    value: Json, where: str, required: set[str], optional: Sequence[str] | set[str] = ()
) -> None:
    """Check that an object has all required fields and no unknown one.

    Raises:
        ManifestError: It lacks one, or has an unknown one.
    """
    missing = sorted(required - value.keys())
    if missing:
        raise ManifestError(f"{where} lacks {', '.join(missing)}.")
    known = required | set(optional)
    for key in value:
        if key not in known:
            raise ManifestError(f"{where} has the unknown field {key!r}. {did_you_mean(key, known)}")


def require_text(value: Json, key: str, where: str) -> str:
    """Return the field as a non-empty string.

    Raises:
        ManifestError: It is not one.
    """
    text = value.get(key)
    if not isinstance(text, str) or not text:
        raise ManifestError.seen(f"{where}.{key}", text, ", but must be a non-empty string.")
    return text


def require_word(value: Json, key: str, where: str, known: Sequence[str]) -> str:
    """Return the field as one of a few words.

    Raises:
        ManifestError: It is none of them; suggests the closest.
    """
    word = require_text(value, key, where)
    if word not in known:
        raise ManifestError.seen(f"{where}.{key}", word, f". {did_you_mean(word, known)}")
    return word


def require_texts(value: Json, key: str, where: str) -> tuple[str, ...]:
    """Return the field as a list of non-empty strings.

    Raises:
        ManifestError: It is not one.
    """
    items = value.get(key)
    if not isinstance(items, list) or not all(isinstance(item, str) and item for item in items):
        raise ManifestError.seen(f"{where}.{key}", items, ", but must be a list of non-empty strings.")
    return tuple(items)


def require_count(value: Json, key: str, where: str) -> int:
    """Return the field as an integer of at least 0.

    Raises:
        ManifestError: It is not one.
    """
    number = value.get(key)
    if isinstance(number, bool) or not isinstance(number, int) or number < 0:
        raise ManifestError.seen(f"{where}.{key}", number, ", but must be an integer of at least 0.")
    return number
