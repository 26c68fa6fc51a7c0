"""Tracks and manifests for people, as Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import load_track, own_tracks, track_names
from pytest_libero_max.errors import counted


def track_lines(folder: Path) -> list[str]:
    """Return the tracks of a folder, each with its number of cases by source, or raise ManifestError."""
    tracks = {name: load_track(name, folder) for name in track_names(folder)}
    lines = [f"Version {tracks[own_tracks(folder)[0]].version}.", "", "## Tracks", ""]
    lines += ["| track | cases | Plus | PRO | unmodified | events | digest |"]
    lines.append("| --- | ---: | ---: | ---: | ---: | ---: | --- |")
    for name, manifest in tracks.items():
        count = Counter(case.source for case in manifest)
        events = len({case.event.name for case in manifest})
        unmodified = sum(case.unmodified for case in manifest)
        numbers = f"{len(manifest)} | {count['plus']} | {count['pro']} | {unmodified} | {events}"
        lines.append(f"| {name} | {numbers} | `{manifest.digest[:16]}` |")
    return lines


def manifest_lines(manifest: Manifest) -> list[str]:
    """Return the composition of a manifest, as Markdown."""
    size = counted(len(manifest), "case")
    title = f"{manifest.benchmark_id} {manifest.version}: {size}, digest {manifest.digest}"
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
