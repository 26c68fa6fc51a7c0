"""Manifests: frozen sets of cases.

The file format is that of the manifests that the authors of LIBERO-MAX released as version 3.0.0; a manifest
that is read and written again has the same bytes. Their files of version 1.0.0 are not played.

Format 2 adds cases that the authors' format cannot express: those with a ``program`` of their own
(:mod:`pytest_libero_max.benchmark.programs`), or with a trigger other than ``on_proximity``. A manifest
declares it in ``manifest_format``; one without the field is of format 1.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from msgspec import Struct

from pytest_libero_max.benchmark.cases import INTENT, PROXIMITY, Case, parse_case
from pytest_libero_max.benchmark.documents import (
    Json,
    canonical_digest,
    read_content,
    refuse_constant,
    text_of,
)
from pytest_libero_max.benchmark.programs import Program
from pytest_libero_max.benchmark.releases import NOT_PLAYED, Recognition, recognise
from pytest_libero_max.benchmark.structs import Positive, Word, checked, require_fields
from pytest_libero_max.errors import ManifestError, OptionError, counted, did_you_mean

SCORING_TRACK = "physical_completion"
"""Scoring by the goal of the task, which stays the same."""

INTENT_TRACK = "intent_response"
"""Scoring by the goal that the event gives, or by stopping where it cancels the task."""

FORMAT_2 = 2
"""Value of ``manifest_format`` where a case needs more than the authors' format."""


@dataclass(frozen=True)
class Manifest:
    """A frozen set of cases with the protocol under which they are played."""

    benchmark_id: str
    version: str
    protocol: Json
    cases: tuple[Case, ...]
    recognition: Recognition | None = field(default=None, compare=False)
    """Relation of its file to the released ones; None where there is none, or no file."""

    def __len__(self) -> int:
        return len(self.cases)

    def __iter__(self) -> Iterator[Case]:
        return iter(self.cases)

    @classmethod
    def of(cls, benchmark_id: str, cases: Iterable[Case], version: str = "1.0.0") -> Manifest:
        """Return a manifest of cases that are scored by the goals of their tasks.

        Args:
            benchmark_id: Its name in reports.
        """
        protocol: Json = {
            "arms": ["control", "intervention"],
            "query_interval": 16,
            "scoring_track": SCORING_TRACK,
        }
        return cls(benchmark_id, version, protocol, tuple(cases))

    @property
    def digest(self) -> str:
        """SHA-256 over the cases in manifest order, hexadecimal: the identity of the case set."""
        return canonical_digest([case.record for case in self.cases])

    def playing(self, program: Program) -> Manifest:
        """Return the manifest with a program laid over the cases that it fits; the others stay as they are.

        Raises:
            ManifestError: A case has one of its own, or the program fits none.
        """
        fit = sum(case.fits(program) for case in self.cases)
        if not fit:
            raise ManifestError(
                f"program {program.name!r} fits none of {counted(len(self), 'case')}: {program.because} "
                "Play others."
            )
        cases = tuple(case.playing(program) if case.fits(program) else case for case in self.cases)
        return replace(self, cases=cases, recognition=None)

    def to_json(self) -> str:
        """Return the manifest's file content: sorted keys, two spaces, a final newline."""
        document: Json = {
            "benchmark_id": self.benchmark_id,
            "benchmark_version": self.version,
            "protocol": self.protocol,
            "cases": [case.record for case in self.cases],
        }
        if any(case.needs_format_2 for case in self.cases):
            document["manifest_format"] = FORMAT_2
        return json.dumps(document, indent=2, sort_keys=True) + "\n"


def load_manifest(path: Path) -> Manifest:
    """Read and check a manifest, ``.json`` or ``.json.gz``.

    Raises:
        ManifestError: The file is missing, is not JSON, or breaks the format; names the file and the case.
    """
    try:
        content = read_content(path)
    except OSError as error:
        raise _unreadable(path, error) from error
    return decode_manifest(content, path)


def decode_manifest(content: bytes, path: Path) -> Manifest:
    """Check the unpacked content of a manifest; see :func:`load_manifest`; raises ManifestError."""
    try:
        text = text_of(content)
    except UnicodeDecodeError as error:
        raise _unreadable(path, error) from error
    try:
        document = json.loads(text, parse_constant=refuse_constant)
    except (ValueError, RecursionError) as error:
        raise ManifestError(
            f"{path}: not a JSON document ({error}). The file is damaged or is not a manifest; restore it.",
            path=path,
            line=getattr(error, "lineno", None),
        ) from error
    named = document.get("benchmark_id") if isinstance(document, dict) else None
    recognition = recognise(text.encode(), path, named)
    released = None if recognition is None else recognition.released
    if released is not None and released.version in NOT_PLAYED and released.benchmark_id == named:
        raise ManifestError(
            f"{path} ({recognition}): version {released.version} is not played. Give a manifest of version "
            "3.0.0 or 2.0.0.",
            path=path,
        )
    try:
        return replace(parse_manifest(document), recognition=recognition)
    except ManifestError as error:
        what = "" if recognition is None else f" ({recognition})"
        raise error.within(f"{path}{what}", path=path) from error


def _unreadable(path: Path, error: Exception) -> ManifestError:
    text = f"Cannot read manifest {str(path)!r}: {error}. Give the path of a JSON manifest."
    return ManifestError(text, path=path)


def parse_manifest(document: Any) -> Manifest:
    """Check a decoded manifest, or raise ManifestError."""
    require_fields(document, _Top, "manifest", ManifestError)
    if document.get("manifest_format", FORMAT_2) != FORMAT_2:
        raise ManifestError.seen(
            "manifest_format",
            document["manifest_format"],
            f", but this version reads {FORMAT_2}, and files "
            "without the field. Use the version of pytest-libero-max that wrote the file, or a newer one.",
        )
    _check_protocol(document["protocol"])
    raw = document["cases"]
    if not isinstance(raw, list) or not raw:
        raise ManifestError("cases must be a non-empty list.")
    cases = tuple(parse_case(record, f"cases[{i}]") for i, record in enumerate(raw))
    _check_scoring(document["protocol"]["scoring_track"], cases)
    beyond = next((case for case in cases if case.needs_format_2), None)
    if beyond is not None and "manifest_format" not in document:
        kind = beyond.event.trigger["type"]
        what = f"scenario.trigger.type={kind!r}" if beyond.program is None else "a program"
        raise ManifestError(
            f"case {beyond.case_id!r} has {what}, but in the format of the authors every event fires "
            f'{PROXIMITY!r}. Repair it, or add "manifest_format": {FORMAT_2} beside "cases".'
        )
    for case_id, count in Counter(case.case_id for case in cases).items():
        if count > 1:
            raise ManifestError.seen("case_id", case_id, f" occurs {count} times; ids must be unique.")
    for item_id, count in Counter(case.item_id for case in cases).items():
        if count > 1:
            raise ManifestError(
                f"{count} cases describe the same configuration {item_id!r}; keep one of them."
            )
    return Manifest(
        benchmark_id=checked(document["benchmark_id"], Word, "manifest.benchmark_id", ManifestError),
        version=checked(document["benchmark_version"], Word, "manifest.benchmark_version", ManifestError),
        protocol=dict(document["protocol"]),
        cases=cases,
    )


class _Top(Struct, frozen=True, forbid_unknown_fields=True):
    benchmark_id: Any
    benchmark_version: Any
    protocol: Any
    cases: Any
    manifest_format: Any = FORMAT_2


class _Protocol(Struct, frozen=True, forbid_unknown_fields=True):
    arms: Any
    query_interval: Positive
    scoring_track: Word
    substrate: Word = ""
    profile: Word = ""
    source_benchmark_commit: Word = ""
    selection_contract: Word = ""


def _check_protocol(value: Any) -> None:
    protocol: _Protocol = checked(value, _Protocol, "protocol", ManifestError)
    if protocol.arms != ["control", "intervention"]:
        raise ManifestError.seen("protocol.arms", protocol.arms, ", but must be ['control', 'intervention'].")
    if protocol.scoring_track not in (SCORING_TRACK, INTENT_TRACK):
        raise ManifestError.seen(
            "protocol.scoring_track",
            protocol.scoring_track,
            f". {did_you_mean(protocol.scoring_track, (SCORING_TRACK, INTENT_TRACK))}",
        )


def _check_scoring(track: str, cases: tuple[Case, ...]) -> None:
    """Check that cases are scored by intent if, and only if, their event changes the task."""
    for case in cases:
        if (case.event.family_code == INTENT) != (track == INTENT_TRACK):
            raise ManifestError(
                f"case {case.case_id!r} has scenario.change_family={case.event.family_code!r}, but "
                f"protocol.scoring_track={track!r}: {INTENT_TRACK!r} is that of cases of {INTENT!r} and no "
                "others. Put the others into a manifest of their own."
            )


def find_case(manifest: Manifest, name: str) -> Case:
    """Return the case with this case id or item id, or the only one whose item id begins like this.

    Raises:
        OptionError: There is no such case; suggests the closest.
    """
    items = {case.item_id: case for case in manifest}
    case = items.get(name) or {case.case_id: case for case in manifest}.get(name)
    begin = [item for item in items if item.startswith(name)]
    if case is None and len(begin) == 1:
        case = items[begin[0]]
    if case is None:
        raise OptionError.seen(
            "case", name, f" is not in {manifest.benchmark_id}. {did_you_mean(name, items)}"
        )
    return case
