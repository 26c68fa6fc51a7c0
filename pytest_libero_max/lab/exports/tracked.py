"""What experiment trackers get of a run: its numbers, a table of its pairs, and its films of regressions."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.report.broken import named_of
from pytest_libero_max.report.exit_status import ended_as_declared
from pytest_libero_max.report.exports import ExportedRun
from pytest_libero_max.report.measurable import is_measurable
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_tables import main_numbers
from pytest_libero_max.report.writers.report_files import report_of
from pytest_libero_max.runs.media import films_in

PREFIX = "libero_max"
"""Beginning of the names of all numbers, tables and films."""

COLUMNS = ("pair", "event", "suite", "outcome", "base", "dynamic", "event_step", "cause")
"""Columns of the table of pairs; the outcome of a pair that could not be measured is error, and
its cause the kind of error. A pair that was not played has no row."""

FILES = ("pairs.jsonl", "report.json", "report.md", "report.html")
"""Files of the run that trackers keep."""

MOST_FILMS = 8
"""Number of films that a tracker gets of a run, one of each cause and event first."""

_LARGEST_PX, _COLOURS = 360, 96
"""Longest side and colours of a film as a GIF: it then takes 0.7 MB instead of 6."""


@dataclass(frozen=True)
class Tracked:
    """A run as trackers get it."""

    numbers: dict[str, float]
    """Numbers by flat name, see :func:`tracked_numbers`."""
    rows: list[list[Any]]
    """A row for each pair, with :data:`COLUMNS`, in the order of their names."""
    films: dict[str, Path]
    """Films of the regressions that have one, by the name of the pair."""
    settings: Json
    """Policy, substrate, selection and provenance of the run."""
    files: list[Path]
    """Those of :data:`FILES` that are there."""


def tracked(run: ExportedRun) -> Tracked:
    """Return a run as trackers get it."""
    report = report_of(run.stored)
    films = films_in(run.folder)
    lost = [pair for pair in report.changed_pairs if pair.outcome == "regression"]
    filmed = [name for name in named_of(lost, len(lost)) if name in films]
    settings = {
        "policy": report.policy,
        "track": run.stored.run.provenance["case_set"]["name"],
        "selection": None if report.selection is None else report.selection.text,
        "substrate": report.substrate.name,
        "note": report.substrate.note,
        "versions": run.stored.run.provenance["versions"],
    }
    files = [run.folder / name for name in FILES if (run.folder / name).is_file()]
    return Tracked(
        {f"{PREFIX}/{name}": number for name, number in tracked_numbers(report).items()},
        sorted(_rows(run, report)),
        {name: run.folder / films[name] for name in filmed[:MOST_FILMS]},
        settings,
        files,
    )


def tracked_numbers(report: Report) -> dict[str, float]:
    """Return the main numbers of a report, and the causes of the pairs that were lost.

    A run that its stopping rule ended has the rates and the change over the pairs that it played, the
    interval that its rule gives for the change over all planned pairs, ``stopped`` 1, and no other interval.
    Where no rule gives one, there is none. A run that is incomplete for another reason has counts alone, and
    one in which Base solves nothing or no event happened has no change.
    """
    pairs, overall = report.pairs, report.overall
    numbers = main_numbers(report)
    numbers["pairs/planned"] = pairs.planned
    by_rule = not pairs.complete and ended_as_declared(pairs)
    if pairs.complete or by_rule:
        numbers["stopped"] = float(by_rule)
        lost = [pair.cause for pair in report.changed_pairs if pair.outcome == "regression"]
        numbers |= {f"causes/{cause}": count for cause, count in Counter(lost).items()}
    if by_rule and pairs.played:
        estimates = {
            "base_success": overall.base_success.value,
            "dynamic_success": overall.dynamic_success.value,
            "paired_change": overall.paired_change.value,
        }
        numbers |= {name: value for name, value in estimates.items() if value is not None}
        numbers |= dict(_interval_of_rule(report))
    if not is_measurable(overall):  # a curve would show a change of 0
        numbers = {name: number for name, number in numbers.items() if "paired_change" not in name}
    return numbers


def _interval_of_rule(report: Report) -> Iterator[tuple[str, float]]:
    """Yield the ends of the change's interval, where the stopping rule watched the change itself."""
    assert report.pairs.stopped is not None
    for watched in report.pairs.stopped.watched:
        of_change = watched.what.split()[0].partition(".")[0] == "delta"  # or a gate on it
        if of_change and watched.lower is not None and watched.upper is not None:
            yield "paired_change_lower", watched.lower
            yield "paired_change_upper", watched.upper
            return


def _rows(run: ExportedRun, report: Report) -> Iterator[list[Any]]:
    causes = {pair.item_id: pair.cause for pair in report.changed_pairs}
    records = {record.case_id: record for record in run.stored.records}
    errors = {error.case_id: error for error in run.stored.errors}
    for pair in run.stored.run.planned:
        row = [pair.item_id, pair.event, pair.suite]
        if (record := records.get(pair.case_id)) is not None:
            successes = [record.arms[arm].success for arm in ("base", "dynamic")]
            cause = causes.get(pair.item_id, "")
            yield [*row, record.outcome, *successes, record.trigger_step, cause]
        elif (error := errors.get(pair.case_id)) is not None:
            yield [*row, "error", None, None, None, error.kind]


def markdown_table(rows: list[list[Any]]) -> str:
    """Return rows of pairs as a table in Markdown."""
    lines = [COLUMNS, ["---"] * len(COLUMNS), *rows]
    return "".join(
        f"| {' | '.join('' if cell is None else str(cell) for cell in line)} |\n" for line in lines
    )


def gif_of(film: Path) -> tuple[bytes, int, int]:
    """Return a film as an animated GIF, which the pages of all trackers show, with its width and height."""
    from PIL import Image, ImageSequence

    if film.suffix == ".mp4":
        frames, durations_ms = _frames_of_video(film)
    else:
        with Image.open(film) as picture:
            # Pillow yields one picture again and again, which knows its duration once it is decoded.
            shown = [
                (frame.convert("RGB"), frame.info["duration"]) for frame in ImageSequence.Iterator(picture)
            ]
        frames, durations_ms = map(list, zip(*shown, strict=True))
    for place, frame in enumerate(frames):
        frame.thumbnail((_LARGEST_PX, _LARGEST_PX))
        frames[place] = frame.quantize(_COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    written = io.BytesIO()
    frames[0].save(written, "GIF", save_all=True, append_images=frames[1:], duration=durations_ms, loop=0)
    return written.getvalue(), *frames[0].size


def _frames_of_video(film: Path) -> tuple[list[Any], list[int]]:
    av = required("av", "film")
    with av.open(str(film)) as container:
        shown = [(frame.time, frame.to_image()) for frame in container.decode(video=0)]
    times_s, frames = zip(*shown, strict=True)
    durations_ms = [round(1000 * (later - time)) for time, later in pairwise(times_s)]
    return [*frames], [*durations_ms, *durations_ms[-1:]] or [0]


def required(package: str, name: str) -> Any:
    """Return a package that a format needs, or refuse with the command that installs it."""
    try:
        return import_module(package)
    except ImportError as error:
        raise OptionError(
            f"format={name!r} needs the package {package.partition('.')[0]}, which cannot be imported here "
            f"({error}). pip install {package.partition('.')[0]}"
        ) from error
