"""Results of the authors' own runner: ``end_to_end_results.jsonl`` and ``paired_results.jsonl``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal, TypeVar

import msgspec
from msgspec import Struct

from pytest_libero_max.benchmark.documents import Json, known, read_content
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import GENUINE, PAPER_LITE, load_cases, load_track
from pytest_libero_max.errors import OptionError, ReportError, counted
from pytest_libero_max.report.readers import PairOutcome, ReadResults, ResultsReader
from pytest_libero_max.runs.outside import require_inside
from pytest_libero_max.runs.plan import PlannedPair

END_TO_END = "end_to_end_results.jsonl"
"""A line for each pair that was measured."""

PAIRED = "paired_results.jsonl"
"""A line for each pair in which a query followed the event."""

LACKS = (
    "These are results of the authors' runner, read from its files and not from records. They hold no proof "
    "that both arms of a case share the executed prefix, no steps, no contacts and no actions, so that there "
    "are no causes, no times and no films."
)


class _EndToEnd(Struct):
    """A line of ``end_to_end_results.jsonl``, as far as it is read; other fields are left alone."""

    pair_id: str
    control_correct: bool
    intervention_correct: bool
    trigger_reached: bool
    response_query_reached: bool
    terminal_status: Literal["triggered", "trigger_unreached", "response_query_unreached"]
    change_type: str
    task_suite_name: str
    severity: str | None = None
    intervention_draw_id: int | None = None

    @property
    def expected_status(self) -> str:
        """The status that its two coverages give."""
        if not self.trigger_reached:
            return "trigger_unreached"
        return "triggered" if self.response_query_reached else "response_query_unreached"


class _Paired(Struct):
    """A line of ``paired_results.jsonl``, as far as it is read."""

    pair_id: str
    control_correct: bool
    intervention_correct: bool
    open_loop_exposure_steps: int | None = None


Line = TypeVar("Line", _EndToEnd, _Paired)


class AuthorsResults(ResultsReader):
    """Reads the folder of results of the authors' runner."""

    name = "authors"

    def recognises(self, folder: Path) -> bool:
        return (folder / END_TO_END).is_file()

    def read(self, folder: Path, cases: str | None) -> ReadResults:
        rows = _lines(folder, END_TO_END, _EndToEnd)
        paired = _lines(folder, PAIRED, _Paired) if (folder / PAIRED).is_file() else {}
        name, manifest = _cases(rows, cases)
        planned = {case.case_id: PlannedPair.of(case) for case in manifest}
        for row in rows.values():
            _require_of_case(row, planned)
        _require_alike(rows, paired)
        outcomes = {
            row.pair_id: PairOutcome(
                row.control_correct,
                row.intervention_correct,
                row.trigger_reached,
                row.response_query_reached,
                None if row.pair_id not in paired else paired[row.pair_id].open_loop_exposure_steps,
            )
            for row in rows.values()
        }
        return ReadResults(
            tuple(planned.values()), outcomes, _provenance(folder, name, manifest), tuple(_notes(outcomes))
        )


def _lines(folder: Path, name: str, kind: type[Line]) -> dict[str, Line]:
    path = require_inside(folder, folder / name)
    lines: dict[str, Line] = {}
    try:
        content = read_content(path)
    except OSError as error:
        raise ReportError(f"Cannot read {path}: {error}.") from error
    for number, text in enumerate(content.splitlines(), start=1):
        if not text.strip():
            continue
        try:
            line = msgspec.json.decode(text, type=kind)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise ReportError(
                f"{path}, line {number}: {error}. Give the file as the authors' runner writes it."
            ) from error
        if line.pair_id in lines:
            raise ReportError(f"{path}, line {number}: pair_id={line.pair_id!r} occurs twice. Keep one line.")
        lines[line.pair_id] = line
    return lines


def _cases(rows: Mapping[str, _EndToEnd], asked: str | None) -> tuple[str, Manifest]:
    """Return the cases that were played, with their name for the case set."""
    name = f"{GENUINE}/{PAPER_LITE}" if asked is None else asked
    manifest = load_track(name) if asked is None else load_cases(name)
    strays = sorted(rows.keys() - {case.case_id for case in manifest})
    if strays:
        whose = "the authors' Lite" if asked is None else name
        raise OptionError(
            f"pair_id={strays[0]!r} ({len(strays)} in all) is no case of {whose}. Give the manifest that was "
            "played with --cases=FILE."
        )
    return (f"track {name}" if asked is None else f"manifest {Path(asked).name}"), manifest


def _require_of_case(row: _EndToEnd, planned: Mapping[str, PlannedPair]) -> None:
    """Check that a line is of the case that it names, and agrees with itself."""
    pair = planned[row.pair_id]
    of_case = {
        "change_type": (row.change_type, pair.event),
        "task_suite_name": (row.task_suite_name, pair.suite),
        "severity": (row.severity or pair.severity, pair.severity),
        "intervention_draw_id": (
            pair.variant if row.intervention_draw_id is None else row.intervention_draw_id,
            pair.variant,
        ),
        "terminal_status": (row.terminal_status, row.expected_status),
    }
    for field, (value, expected) in of_case.items():
        if value != expected:
            raise ReportError(
                f"{END_TO_END}: {field}={value!r} of pair {row.pair_id!r}, but expected {expected!r}: the "
                "line is of another case, or damaged. Give the manifest that was played with --cases=FILE."
            )


def _require_alike(rows: Mapping[str, _EndToEnd], paired: Mapping[str, _Paired]) -> None:
    for line in paired.values():
        row = rows.get(line.pair_id)
        if row is None or not row.response_query_reached:
            raise ReportError(
                f"{PAIRED}: pair_id={line.pair_id!r}, but {END_TO_END} has no such pair with a query after "
                "the event. Both files must be of one run."
            )
        for field in ("control_correct", "intervention_correct"):
            if getattr(row, field) != getattr(line, field):
                raise ReportError(
                    f"{PAIRED}: {field}={getattr(line, field)} of pair {line.pair_id!r}, but "
                    f"{getattr(row, field)} in {END_TO_END}. Both files must be of one run."
                )


def _notes(outcomes: Mapping[str, PairOutcome]) -> Iterator[str]:
    yield LACKS
    apart = sum(it.base != it.dynamic for it in outcomes.values() if not it.triggered)
    if apart:
        yield (
            f"In {counted(apart, 'pair')} the event never happened and the arms still end differently: these "
            "arms do not share their prefix, or the policy does not repeat itself."
        )
    unknown = sum(it.responded and it.stale is None for it in outcomes.values())
    if unknown:
        yield (
            f"Stale actions are not shown: {PAIRED} does not say them of {counted(unknown, 'pair')} with a "
            "query after the event."
        )


def _provenance(folder: Path, name: str, manifest: Manifest) -> Json:
    """Return the origin of the results: the authors' runner plays genuine scenes, as published."""
    recognition = manifest.recognition
    return {
        "versions": {},
        "platform": {},
        "git": None,
        "substrate": {
            "name": "libero",
            "semantics": "published",
            "instruction_source": "published",
            "source_variations": "installed",
        },
        "case_set": {
            "name": name,
            "digest": manifest.digest,
            **known(released_as=None if recognition is None else str(recognition)),
        },
        "policy": {"reference": folder.resolve().name},
        "protocol": {},
        "command": [],
    }
