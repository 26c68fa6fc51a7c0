"""Texts and tables about tracks, manifests, cases and examinations, as the commands print them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import load_track, track_names
from pytest_libero_max.construction.configurations import cell_of
from pytest_libero_max.construction.examination import Certificate, Examination
from pytest_libero_max.construction.preflight import CHECKS
from pytest_libero_max.construction.release import read_certificates, read_rejected
from pytest_libero_max.events.registry import BENCHMARK_EVENTS

OVERVIEW = "README.md"

_WORST = 5  # cells that are named


def write_overview(folder: Path) -> None:
    """Write the ``README.md`` of a folder of tracks.

    Raises:
        ManifestError: A file is missing or is not the one that was frozen.
    """
    head = ["# Frozen cases", "", "Written by `libero-max build` from the files beside it.", ""]
    (folder / OVERVIEW).write_text("\n".join([*head, *overview_lines(folder), ""]), encoding="utf-8")


def overview_lines(folder: Path) -> list[str]:
    """All tracks of a folder, what was rejected and why, and how many cases the expert solves: Markdown.

    Raises:
        ManifestError: A file is missing or is not the one that was frozen.
    """
    tracks = {name: load_track(name, folder) for name in track_names(folder)}
    rejected, certificates = read_rejected(folder), read_certificates(folder)
    whole = tracks["max"]
    lines = ["## Tracks", "", "| track | cases | Plus | PRO | unmodified | events | digest |"]
    lines.append("| --- | ---: | ---: | ---: | ---: | ---: | --- |")
    for name, manifest in tracks.items():
        count = Counter(case.source for case in manifest)
        events = len({case.event.name for case in manifest})
        numbers = f"{len(manifest)} | {count['plus']} | {count['pro']} | {count['libero']} | {events}"
        lines.append(f"| {name} | {numbers} | `{manifest.digest[:16]}` |")
    lines += ["", "## Rejected by the preflight", "", "First reason of each rejected case, by event.", ""]
    lines += _rejections({name: problems[0].check for name, problems in rejected.items()})
    lines += [
        "",
        "## Certificates",
        "",
        "Cases of `max` whose Dynamic episode the scripted expert completes.",
    ]
    by_event = _count(((case.event.name, case) for case in whole), certificates)
    by_category = _count(((case.source_category, case) for case in whole), certificates)
    by_cell = _count(((str(cell_of(case)), case) for case in whole), certificates)
    lines += ["", *_shares("event", by_event), "", *_shares("category", by_category)]
    worst = sorted(by_cell, key=lambda cell: (by_cell[cell][0] / by_cell[cell][1], cell))[:_WORST]
    shares = "; ".join(f"{cell}: {by_cell[cell][0]}/{by_cell[cell][1]}" for cell in worst)
    return [*lines, "", f"The cells with the smallest shares: {shares}"]


def examination_lines(examinations: Mapping[str, Examination]) -> list[str]:
    """What was found when some cases were examined: totals, then each case that failed."""
    failed = {name: found.problems for name, found in sorted(examinations.items()) if found.problems}
    certificates = {
        name: found.certificate for name, found in sorted(examinations.items()) if found.certificate
    }
    lines = [f"{len(examinations) - len(failed)} of {len(examinations)} cases pass the preflight."]
    if failed:
        lines += ["", *_rejections({name: problems[0].check for name, problems in failed.items()}), ""]
        lines += [f"{name}: {'; '.join(map(str, problems))}" for name, problems in failed.items()]
    if certificates:
        lost = [name for name, found in certificates.items() if not found.solved]
        won, of = len(certificates) - len(lost), len(certificates)
        lines += ["", f"The expert completes {won} of the {of} that pass."]
        lines += [f"not completed: {name}" for name in lost]
    return lines


def manifest_lines(manifest: Manifest) -> list[str]:
    """The composition of a manifest, as Markdown."""
    title = f"{manifest.benchmark_id} {manifest.version}: {len(manifest)} cases, digest {manifest.digest}"
    lines = [title, "", *(f"- {key}: {value}" for key, value in sorted(manifest.protocol.items()))]
    views: tuple[tuple[str, Callable[[Case], object]], ...] = (
        ("event", lambda case: f"{case.event.name}, variant {case.event.variant}"),
        ("suite", lambda case: case.suite),
        ("source category", lambda case: f"{case.source}: {case.source_category}"),
        ("difficulty", lambda case: case.difficulty or "none"),
    )
    for view, key in views:
        count = Counter(str(key(case)) for case in manifest)
        lines += ["", f"| {view} | cases |", "| --- | ---: |"]
        lines += [f"| {name} | {number} |" for name, number in sorted(count.items())]
    return lines


def _rejections(checks: Mapping[str, str]) -> list[str]:
    """A table of the check that each case failed at, by event."""
    seen = [check for check in CHECKS if check in checks.values()]
    lines = [f"| event | rejected | {' | '.join(seen)} |", f"| --- |{' ---: |' * (len(seen) + 1)}"]
    for event in (*BENCHMARK_EVENTS, ""):
        count = Counter(check for name, check in checks.items() if not event or f"-{event}-" in name)
        numbers = " | ".join(str(count[check]) for check in seen)
        lines.append(f"| {event or 'all'} | {count.total()} | {numbers} |")
    return lines


def _count(
    keyed: Iterable[tuple[str, Case]], certificates: Mapping[str, Certificate]
) -> dict[str, tuple[int, int]]:
    """Solved and all cases by key."""
    solved, played = Counter[str](), Counter[str]()
    for key, case in keyed:
        played[key] += 1
        solved[key] += certificates[case.case_id].solved
    return {key: (solved[key], played[key]) for key in played}


def _shares(title: str, counts: Mapping[str, tuple[int, int]]) -> list[str]:
    lines = [f"| {title} | solved | cases | share |", "| --- | ---: | ---: | ---: |"]
    total = sum(won for won, _ in counts.values()), sum(of for _, of in counts.values())
    for name, (won, of) in {**counts, "all": total}.items():
        lines.append(f"| {name} | {won} | {of} | {100 * won / of:.1f}% |")
    return lines
