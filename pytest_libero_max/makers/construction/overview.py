"""Texts and tables about tracks, manifests, cases and examinations, as the commands print them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.certificates import ENDINGS, Certificate, read_certificates
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.track_text import track_lines
from pytest_libero_max.benchmark.tracks import load_track, own_tracks, track_names
from pytest_libero_max.events.configurations import Cell, cell_of
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.makers.construction.preflight import CHECKS, Preflight
from pytest_libero_max.makers.construction.release import read_rejected, read_sights, read_unexamined
from pytest_libero_max.makers.construction.visibility import IMAGE_SIZE, MIN_PIXELS, Sight

OVERVIEW = "README.md"

_ONCE = "Cases of all tracks, each counted once:"


def write_overview(folder: Path) -> None:
    """Write the ``README.md`` of a folder of tracks."""
    head = ["# Frozen cases", "", "Written by `libero-max dev build` from the files beside it.", ""]
    (folder / OVERVIEW).write_text("\n".join([*head, *overview_lines(folder), ""]), encoding="utf-8")


def overview_lines(folder: Path) -> list[str]:
    """Return the tracks of a folder, rejected cases and the expert's successes, as Markdown."""
    tracks = {name: load_track(name, folder) for name in track_names(folder)}
    rejected, certificates = read_rejected(folder), read_certificates(folder)
    own = {name: tracks[name] for name in own_tracks(folder)}
    every = {case.case_id: case for manifest in own.values() for case in manifest}.values()
    cases = [case for case in every if case.program is None]
    lines = track_lines(folder)
    for name in tracks.keys() - own.keys():
        lines += ["", f"`{name}` is {tracks[name].recognition}; the tables below are of the other tracks."]
    lines += ["", "## Rejected by the preflight", "", "First reason of each rejected case, by event.", ""]
    lines += _rejections({name: problems[0].check for name, problems in rejected.items()})
    unexamined = read_unexamined(folder)
    if unexamined:
        lines += ["", *_unexamined_lines(own, cases, unexamined)]
    lines += ["", *_out_of_sight_lines(cases, read_sights(folder))]
    lines += ["", *_certificate_lines(cases, certificates)]
    return [*lines, *_program_lines(every, certificates)]


def _unexamined_lines(
    tracks: Mapping[str, Manifest], cases: Iterable[Case], unexamined: Mapping[str, str]
) -> list[str]:
    """Lines on the cases of each track that were not examined and why, and on those examined by category."""
    lines = [
        "## Not examined",
        "",
        "The models of these cases were not there, so nothing is known about their events. Where the models",
        "are, `libero-max dev preflight genuine/TRACK --substrate libero --libero-assets FOLDER` examines "
        "them.",
        "",
        f"| missing | {' | '.join(tracks)} |",
        "| --- |" + " ---: |" * len(tracks),
    ]
    for missing, _ in Counter(unexamined.values()).most_common():
        counts = (sum(unexamined.get(case.case_id) == missing for case in track) for track in tracks.values())
        lines.append(f"| {missing} | {' | '.join(map(str, counts))} |")
    lines += ["", _ONCE, "", "| category | examined | not examined |", "| --- | ---: | ---: |"]
    count = Counter((case.source_category, case.case_id in unexamined) for case in cases)
    for category in dict.fromkeys(category for category, _ in count):
        lines.append(f"| {category} | {count[category, False]} | {count[category, True]} |")
    return lines


def _certificate_lines(cases: Sequence[Case], certificates: Mapping[str, Certificate]) -> list[str]:
    """Lines on the expert's results: by event with the ways in which it failed, then solved cases by cell."""
    lines = [
        "## Certificates",
        "",
        "The scripted expert completes the Dynamic episode of a *solved* case. In the others it never comes",
        "near the trigger entity (*not triggered*), does not complete the task without the event either",
        "(*Base unsolved*), or completes it without the event only (*unsolved*). None of this decides which",
        "cases are used. Why a case is unsolved was not examined, unless `reports/construction.md` says it.",
        "",
        _ONCE,
        "",
        *_endings("event", BENCHMARK_EVENTS, [(case.event.name, case) for case in cases], certificates),
    ]
    played = {case.case_id: certificates.get(case.case_id) for case in cases}
    solved, of = Counter[Cell](), Counter[Cell]()
    for case in cases:
        certificate = played[case.case_id]
        if certificate is not None:
            of[cell_of(case)] += 1
            solved[cell_of(case)] += certificate.solved
    lines += ["", "Solved cases of those played, by cell: variant 0 and variant 1 of each event.", ""]
    lines += [f"| category | {' | '.join(BENCHMARK_EVENTS)} |", "| --- |" + " ---: |" * len(BENCHMARK_EVENTS)]
    for category in dict.fromkeys(case.source_category for case in cases):
        cells = [[Cell(category, event, variant) for variant in (0, 1)] for event in BENCHMARK_EVENTS]
        row = [" ".join(f"{solved[cell]}/{of[cell]}" for cell in pair) for pair in cells]
        lines.append(f"| {category} | {' | '.join(row)} |")
    return lines


def _program_lines(cases: Iterable[Case], certificates: Mapping[str, Certificate]) -> list[str]:
    labelled = [(case.program.name, case) for case in cases if case.program is not None]
    if not labelled:
        return []
    return [
        "",
        "The same of the cases of `beyond`, of which Dynamic is what the program makes of it:",
        "",
        *_endings("program", sorted({name for name, _ in labelled}), labelled, certificates),
    ]


def _endings(
    head: str,
    groups: Iterable[str],
    cases: Sequence[tuple[str, Case]],
    certificates: Mapping[str, Certificate],
) -> list[str]:
    """Return a table of the ways in which the expert's episodes ended, by group and of all cases."""
    lines = [
        f"| {head} | cases | not played | solved | not triggered | Base unsolved | unsolved |",
        "| --- |" + " ---: |" * (2 + len(ENDINGS)),
    ]
    for group in (*groups, ""):
        results = [certificates.get(case.case_id) for name, case in cases if group in ("", name)]
        count = Counter("not_played" if result is None else result.ending for result in results)
        numbers = " | ".join(str(count[ending]) for ending in ("not_played", *ENDINGS))
        lines.append(f"| {group or 'all'} | {count.total()} | {numbers} |")
    return lines


def _out_of_sight_lines(cases: Iterable[Case], sights: Mapping[str, tuple[Sight, ...]]) -> list[str]:
    """Lines on the events that take target or receptacle out of view, by event and by suite."""
    lines = [
        "## Out of sight after the event",
        "",
        "Examined cases in which the target or the receptacle is seen just before the event and not just",
        f"after it: *seen* means {MIN_PIXELS} pixels or more of {IMAGE_SIZE} x {IMAGE_SIZE}. *Agent* counts",
        "the agent's image, *both* the cases in which neither of a policy's two cameras sees it any more.",
        "Only a camera shift may hide it from both: the authors keep every camera shift, and so do these",
        "tracks.",
        "",
        _ONCE,
        "",
        "| event | suite | examined | target, agent | target, both | receptacle, agent | receptacle, both |",
        "| --- | --- |" + " ---: |" * 5,
    ]
    rows: dict[tuple[str, str], Counter[str]] = {}
    for case in cases:
        if case.case_id not in sights:
            continue
        row = rows.setdefault((case.event.name, case.suite), Counter())
        row["cases"] += 1
        for sight in sights[case.case_id]:
            row[f"{sight.role}, agent"] += sight.before[0] >= MIN_PIXELS > sight.after[0]
            row[f"{sight.role}, both"] += sight.seen_before and not sight.seen_after
    for (event, suite), row in sorted(rows.items()):
        if row.total() > row["cases"]:
            numbers = (
                row[f"{role}, {where}"] for role in ("target", "receptacle") for where in ("agent", "both")
            )
            lines.append(f"| {event} | {suite} | {row['cases']} | {' | '.join(map(str, numbers))} |")
    return lines


def preflight_lines(preflights: Mapping[str, Preflight]) -> list[str]:
    """Lines on examinations: totals, then each case that failed."""
    failed = {name: result.problems for name, result in sorted(preflights.items()) if result.problems}
    lines = [f"{len(preflights) - len(failed)} of {len(preflights)} cases pass the preflight."]
    if failed:
        lines += ["", *_rejections({name: problems[0].check for name, problems in failed.items()}), ""]
        lines += [f"{name}: {'; '.join(map(str, problems))}" for name, problems in failed.items()]
    return lines


def certificate_lines(certificates: Mapping[str, Certificate]) -> list[str]:
    """Lines on the expert's results: the total, then each case that it did not complete."""
    lost = {name: result.ending for name, result in sorted(certificates.items()) if not result.solved}
    lines = [f"The expert completes {len(certificates) - len(lost)} of the {len(certificates)} that pass."]
    return [*lines, *(f"{name}: {ending.replace('_', ' ')}" for name, ending in lost.items())]


def _rejections(checks: Mapping[str, str]) -> list[str]:
    """Return a table of the check that each case failed at, by event."""
    seen = [check for check in CHECKS if check in checks.values()]
    lines = [f"| event | rejected | {' | '.join(seen)} |", f"| --- |{' ---: |' * (len(seen) + 1)}"]
    for event in (*BENCHMARK_EVENTS, ""):
        count = Counter(check for name, check in checks.items() if not event or f"-{event}-" in name)
        numbers = " | ".join(str(count[check]) for check in seen)
        lines.append(f"| {event or 'all'} | {count.total()} | {numbers} |")
    return lines
