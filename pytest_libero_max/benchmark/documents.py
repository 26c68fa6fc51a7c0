"""JSON documents of the benchmark: canonical form, digests, and compressed files."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import os
import stat
import zlib
from pathlib import Path
from typing import Any

Json = dict[str, Any]

MOST_BYTES = 2**31
"""Largest size, bytes, that a packed file may unpack to. A run of 8,000 pairs has some 50 MB."""

_PART = 2**20


def known(**values: Any) -> Json:
    """Return the values that are not None, by name."""
    return {name: value for name, value in values.items() if value is not None}


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
    """Return the bytes of a file, unpacked where its name ends in ``.gz``, or raise OSError."""
    require_regular(path)
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


def text_of(content: bytes) -> str:
    """Return the text of a file that a person may have written: UTF-8, without the byte-order mark.

    Some editors begin a file with that mark, which neither JSON nor TOML knows.
    """
    return content.decode("utf-8-sig")


def read_text(path: Path) -> str:
    """Return the text of a file that a person may have written; its lines end in ``\\n``."""
    return path.read_text(encoding="utf-8-sig")


def _spelled(letter: str) -> str:
    return letter if letter.isprintable() else letter.encode("unicode_escape").decode()


def require_regular(path: Path) -> None:
    """Check that a path is not that of a device or a pipe, which may never end, or raise OSError."""
    if not stat.S_ISREG(path.stat().st_mode) and not path.is_dir():
        raise OSError(f"{path} is no regular file")


def refuse_constant(name: str) -> float:
    """Refuse ``NaN`` and ``Infinity``, as ``parse_constant`` of :func:`json.loads`."""
    raise ValueError(f"{name} is not JSON")


def slug(text: str) -> str:
    """Return a name as one word of an id: lower case, underscores for spaces."""
    return text.lower().replace(" ", "_")


def cut_torn_line(path: Path) -> bool:
    """Remove the end of a file of lines after its last line end: a line that a kill cut off.

    Returns:
        True if there was one.
    """
    content = path.read_bytes()
    whole = content.rfind(b"\n") + 1
    if whole == len(content):
        return False
    os.truncate(path, whole)
    return True
