"""A published run: its packed pairs, from which every report follows, and its report in Markdown.

It is written, and checked by those who did not write it.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import io
import json
import re
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import zip_longest
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import msgspec
import numpy as np

from pytest_libero_max.benchmark.array_files import read_arrays
from pytest_libero_max.benchmark.documents import MOST_BYTES, read_content
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.benchmark.structs import decode_json
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import LiberoMaxError, ReportError
from pytest_libero_max.pairing.trace import trace_name
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.report_files import (
    HTML_NAME,
    MARKDOWN_NAME,
    REPORT_NAME,
    all_figures,
    make_folder,
    report_json,
    report_of,
    run_page,
    write_bytes,
    write_text,
)
from pytest_libero_max.runs.media import TRACES_NAME, films_in
from pytest_libero_max.runs.outside import require_inside
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.replay_command import traces_setting
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, StoredRun, pairs_file, read_pairs

ABOUT_NAME = "about.json"

_ABOUT_CURE = "libero-max publish pack RUN FOLDER --authors TEXT --model ADDRESS writes it."


class About(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Statements of whoever publishes a run."""

    authors: str = ""
    model: str = ""
    """Address of the model's page, https or http; empty where it is not stated."""

    def __post_init__(self) -> None:
        if self.model and urlsplit(self.model).scheme not in ("http", "https"):
            raise ValueError(
                f"model={self.model!r}, but must be an address on the web, such as https://host/name"
            )

    def to_json(self) -> str:
        return json.dumps(msgspec.to_builtins(self), indent=1) + "\n"


def about_of(folder: Path) -> About:
    """Return what is stated of a published run; nothing where its folder has no such file."""
    path = folder / ABOUT_NAME
    if not path.exists():
        return About()
    try:
        return msgspec.convert(decode_json(require_inside(folder, path).read_bytes(), _ABOUT_CURE), About)
    except (OSError, ValueError) as error:
        raise ReportError(f"Cannot read {path}: {error}. {_ABOUT_CURE}") from error


def publish(run: Path, folder: Path, actions: bool = False, about: About | None = None) -> list[Path]:
    """Write the packed pairs of a finished run and its report in Markdown.

    The same pairs give the same files.

    Args:
        folder: Made where it is missing. Files of these names are replaced.
        actions: True to write the recorded actions as well, with which others replay the pairs without the
            policy.

    Raises:
        ReportError: The run cannot be read or is not complete, keeps no actions of a pair, or the files
            cannot be written.
    """
    stored = read_pairs(run)
    report = report_of(stored)
    if not report.pairs.complete:
        raise ReportError(
            f"{run} is incomplete: {report.headline.reason}. Continue it with --libero-max-resume."
        )
    files = {MARKDOWN_NAME: markdown(report, films_in(folder)).encode()}
    try:
        files[PACKED_PAIRS_NAME] = gzip.compress(read_content(pairs_file(run)), mtime=0)
    except OSError as error:
        raise ReportError(f"Cannot read the pairs of {run}: {error}.") from error
    if about is not None:
        files[ABOUT_NAME] = about.to_json().encode()
    written = [folder / name for name in files]
    make_folder(folder)
    if actions:
        names = [trace_name(record.item_id) for record in stored.records]
        traces = {name: require_inside(run, run / TRACES_NAME / name) for name in names}
        files |= {f"{TRACES_NAME}/{name}": _actions(trace, stored) for name, trace in traces.items()}
        written.append(folder / TRACES_NAME)
        make_folder(folder / TRACES_NAME)
    for name, content in files.items():
        write_bytes(folder / name, content)
    return written


def _actions(trace: Path, stored: StoredRun) -> bytes:
    try:
        arrays = read_arrays(trace)
    except (OSError, ValueError) as error:
        setting = traces_setting(stored.run.provenance)
        raise ReportError(
            f"Cannot read the actions in {trace}: {error}. Play the run again with {setting}."
        ) from error
    file = io.BytesIO()
    kept = {name: values for name, values in arrays.items() if not name.endswith("_joints")}
    np.savez_compressed(file, allow_pickle=False, **kept)
    return file.getvalue()


def checked(folder: Path) -> Iterator[str]:
    """Compute everything in a published folder again from its pairs, and compare.

    It shows that the folder agrees with itself and with the frozen cases, not that the pairs were ever
    played: that takes playing some again.

    Yields:
        The checks that passed, a line each, and what was not checked.

    Raises:
        ReportError: The first thing that is not as it must be.
    """
    stored = _read_whole(folder)
    report = report_of(stored)
    if not report.pairs.complete:
        raise ReportError(f"{folder} is incomplete: {report.headline.reason}. {_CURE}")
    yield f"pairs: {report.pairs.played} of {report.pairs.planned} planned pairs, each line well-formed"
    yield _check_cases(stored, folder)
    if not (folder / MARKDOWN_NAME).is_file():
        raise ReportError(f"{folder} has no {MARKDOWN_NAME}, which every published run has. {_CURE}")
    texts = _texts(report, folder)
    for name, text in texts.items():
        _require_text(folder / name, text)
    if (folder / HTML_NAME).is_file():
        _require_page(folder / HTML_NAME, run_page(report, stored, folder))
        texts[HTML_NAME] = ""
    yield f"numbers: as the pairs give them in {', '.join(texts)}"
    other = sorted({path.name for path in folder.iterdir()} - {PACKED_PAIRS_NAME, *texts})
    if other:
        yield f"not checked: {', '.join(other)}"


_SHOWN = 120
"""Characters of a line that a message shows."""

_PACKED = re.compile(r"(?<='>)[^<]*(?=</script>)")
"""What a page holds as gzip in base64."""

_CURE = "Ask its author for the folder as libero-max publish pack writes it, or publish the run again."


def _read_whole(folder: Path) -> StoredRun:
    if not (folder / PACKED_PAIRS_NAME).is_file():
        raise ReportError(
            f"{folder} has no {PACKED_PAIRS_NAME}, so it is no published run. "
            f"Make one: libero-max publish pack RUN {folder}."
        )
    stored = read_pairs(require_inside(folder, folder / PACKED_PAIRS_NAME))
    if stored.torn:
        raise ReportError(f"{folder / PACKED_PAIRS_NAME} ends within a line. {_CURE}")
    return stored


def _check_cases(stored: StoredRun, folder: Path) -> str:
    """Check that the planned pairs are those of the selection, and of the frozen track."""
    planned, provenance = stored.run.planned, stored.run.provenance
    if provenance.get("selection"):
        Selection.from_dict(provenance["selection"]).require(pair.case_id for pair in planned)
    case_set = provenance["case_set"]
    kind, _, name = case_set["name"].partition(" ")
    if kind != "track" or not name or case_set.get("program"):
        return f"not checked: cases of {case_set['name']}, which is no frozen track"
    try:
        track = load_track(name)
    except LiberoMaxError as error:
        return f"not checked: cases of {case_set['name']} ({error})"
    if track.digest != case_set["digest"]:
        raise ReportError(
            f"{folder} names the {case_set['name']} with digest={case_set['digest']!r}, but here it has "
            f"{track.digest!r}. Install the version of pytest-libero-max that it was played with."
        )
    frozen = {case.case_id: PlannedPair.of(case) for case in track}
    for pair in planned:
        if pair != frozen.get(pair.case_id):
            raise ReportError(
                f"The planned pair {pair.case_id!r} of {folder} differs from the case of the "
                f"{case_set['name']}; a published run plays frozen cases as they are. {_CURE}"
            )
    return f"cases: {len(planned)} of the {len(frozen)} of the {case_set['name']}, as they were frozen"


def _texts(report: Report, folder: Path) -> dict[str, str]:
    """Return what the files of a folder must hold, of those that follow from its pairs."""
    texts = {MARKDOWN_NAME: markdown(report, films_in(folder)), REPORT_NAME: report_json(report)}
    if [*folder.glob("*.svg")]:
        texts |= {f"{stem}.svg": svg for stem, svg in all_figures(report).items()}
    return {name: text for name, text in texts.items() if (folder / name).is_file()}


def _require_text(path: Path, expected: str) -> None:
    found = require_inside(path.parent, path).read_bytes().decode(errors="replace")
    if found == expected:
        return
    lines = zip_longest(found.splitlines(), expected.splitlines(), fillvalue="(nothing)")
    different = [(number, *pair) for number, pair in enumerate(lines, start=1) if pair[0] != pair[1]]
    number, one, other = (*different, (1, "other line ends", "line feeds"))[0]
    one, other = one.strip(), other.strip()
    equal = next((at for at, pair in enumerate(zip(one, other, strict=False)) if pair[0] != pair[1]), 0)
    one, other = _near(one, equal), _near(other, equal)
    raise ReportError(
        f"{path}, line {number}: {one!r}, but its pairs give {other!r}. A published report follows from the "
        f"pairs beside it. {_CURE} Another version of the package may write other text: libero-max publish "
        f"pack {path.parent} {path.parent} writes that of this one."
    )


def _require_page(path: Path, expected: str) -> None:
    """Compare a page, with what it holds packed: versions of zlib pack the same to other bytes."""
    found = require_inside(path.parent, path).read_bytes().decode(errors="replace")
    (words, packed), (wanted, content) = _apart(found), _apart(expected)
    if (words, packed) == (wanted, content):
        return
    what = "cases" if words == wanted else "words or drawings"
    raise ReportError(
        f"{path} shows {what} that its pairs do not give. A page follows from the pairs beside it, without "
        f"gates, as libero-max report {path.parent} writes it. {_CURE}"
    )


def _apart(page: str) -> tuple[str, list[bytes]]:
    """Return a page without what it holds packed, and that unpacked; what cannot be unpacked as it is."""
    return _PACKED.sub("", page), [_unpacked(text) for text in _PACKED.findall(page)]


def _unpacked(text: str) -> bytes:
    try:
        unpacker = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
        return unpacker.decompress(base64.b64decode(text), MOST_BYTES)
    except (ValueError, zlib.error):
        return text.encode()


def _near(line: str, place: int) -> str:
    """Return a line, or the part of a long one around a place."""
    if len(line) <= _SHOWN:
        return line
    begin = max(0, place - _SHOWN // 2)
    end = begin + _SHOWN
    return ("… " if begin else "") + line[begin:end] + (" …" if end < len(line) else "")


class PlayedAgain(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A check of a published run in which pairs were played again and all ended alike."""

    pairs: int
    seed: str
    date: str
    """Day of the check, UTC."""
    package: str
    mujoco: str
    actions: bool = False
    """True if the recorded actions were executed, and no policy asked."""


def pairs_digest(folder: Path) -> str:
    """Return the SHA-256 of the pairs of a published run, unpacked: a check belongs to these bytes alone."""
    try:
        return hashlib.sha256(read_content(require_inside(folder, folder / PACKED_PAIRS_NAME))).hexdigest()
    except OSError as error:
        raise ReportError(f"Cannot read {folder / PACKED_PAIRS_NAME}: {error}.") from error


def read_checks(path: Path) -> dict[str, PlayedAgain]:
    """Return the checks that :func:`note_check` wrote, by digest; none where the file does not exist."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ReportError(f"Cannot read {path}: {error}.") from error
    cure = "libero-max publish verify FOLDER --record writes such a file."
    try:
        values: Any = decode_json(content, cure)
        return msgspec.convert(values, dict[str, PlayedAgain])
    except (ReportError, msgspec.ValidationError) as error:
        raise ReportError(f"{path} holds no checks of published runs: {error}. {cure}") from error


def note_check(path: Path, folder: Path, pairs: int, seed: str, actions: bool) -> None:
    """Note in a file that pairs of a published run were played again and ended alike."""
    from importlib.metadata import version

    today, package, mujoco = (
        datetime.now(UTC).date().isoformat(),
        version("pytest-libero-max"),
        version("mujoco"),
    )
    check = PlayedAgain(pairs, seed, today, package, mujoco, actions)
    checks = read_checks(path) | {pairs_digest(folder): check}
    text = json.dumps(msgspec.to_builtins(checks), indent=1, sort_keys=True)
    write_text(path, f"{text}\n")
