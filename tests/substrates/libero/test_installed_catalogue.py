"""The catalogues of packages, here made up of LIBERO's own files, and the tracks chosen from them."""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.tracks import CHECKSUMS, load_track, track_names
from pytest_libero_max.cli import main
from pytest_libero_max.errors import ManifestError, OptionError, SubstrateError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible_events
from pytest_libero_max.makers.construction import case_selection, genuine_tracks, splits, verification
from pytest_libero_max.makers.construction.genuine_tracks import build_genuine, candidates_of, propose_smoke
from pytest_libero_max.makers.construction.overview import overview_lines
from pytest_libero_max.makers.construction.preflight import Preflight, Problem
from pytest_libero_max.makers.construction.release import read_rejected, read_unexamined, write_release
from pytest_libero_max.makers.construction.verification import verify
from pytest_libero_max.makers.construction.visibility import Sight
from pytest_libero_max.substrates.libero.installation import Installation, find_installation
from pytest_libero_max.substrates.libero.installed_catalogue import InstalledCatalogue, describe
from pytest_libero_max.substrates.libero.tasks import task_names
from pytest_libero_max.tasks.contents import task_metadata
from tests.substrates.libero.data import DATA, SUITES

CATEGORIES = {
    "_table_1": "Background Textures",
    "_view_0_0_100_0_0_initstate_11": "Robot Initial States",
    "_view_0_0_100_2_4_initstate_0": "Camera Viewpoints",
    "_language_3_view_0_0_100_0_0_initstate_0": "Language Instructions",
    "_view_0_0_100_0_0_initstate_0_noise_17": "Sensor Noise",
    "_level1_sample1": "Objects Layout",
    "_light_2": "Light Conditions",
}
"""One variation of each of LIBERO-Plus's categories, by what its name ends with."""


@pytest.fixture(scope="module")
def packages(
    installation: Installation, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Installation, Installation]:
    """A LIBERO-PRO without files of its own, and a LIBERO-Plus with a variation of each task and category."""
    root = tmp_path_factory.mktemp("packages")
    pro = _package(root / "pro" / "libero" / "libero")
    (root / "pro" / "libero_ood").mkdir()
    shutil.copy(installation.package / "benchmark" / "libero_suite_task_map.py", pro / "benchmark")
    (pro / "bddl_files").symlink_to(installation.bddl)
    (pro / "init_files").symlink_to(installation.states)
    plus = _package(root / "plus" / "liberoplus" / "liberoplus")
    (plus / "init_files").mkdir()
    tasks: dict[str, list[str]] = {}
    rows: dict[str, list[dict[str, object]]] = {}
    for suite in SUITES:
        bases = task_names(installation, suite)[:10]
        tasks[suite] = [base + ending for ending in CATEGORIES for base in bases]
        (plus / "bddl_files" / suite).mkdir(parents=True)
        for base in bases:
            for stem in (base, *(base + ending.partition("_view_")[0] for ending in CATEGORIES)):
                link = plus / "bddl_files" / suite / f"{stem}.bddl"
                if not link.exists():
                    link.symlink_to(installation.bddl / suite / f"{base}.bddl")
        rows[suite] = [
            {
                "id": number,
                "name": name,
                "category": CATEGORIES[_ending(name)],
                "difficulty_level": 1 + number % 5,
            }
            for number, name in enumerate(tasks[suite])
        ]
    (plus / "benchmark" / "libero_suite_task_map.py").write_text(f"libero_task_map = {tasks!r}")
    (plus / "benchmark" / "task_classification.json").write_text(json.dumps(rows))
    assets = DATA / "assets"
    return find_installation(root / "pro", assets=assets), find_installation(root / "plus", assets=assets)


def _package(folder: Path) -> Path:
    (folder / "benchmark").mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    return folder


def _ending(name: str) -> str:
    return next(ending for ending in CATEGORIES if name.endswith(ending))


@pytest.fixture(scope="module")
def catalogue(packages: tuple[Installation, Installation]) -> InstalledCatalogue:
    return InstalledCatalogue(packages)


PASSED = Preflight((), (Sight("target", "a_bowl", (100, 200), (90, 210)),))


def passing(cases: Sequence[Case]) -> dict[str, Preflight]:
    return {case.case_id: PASSED for case in cases}


def test_descriptions_are_read_in_order() -> None:
    pytest.importorskip("bddl", reason="LIBERO's parser")
    found = describe(
        "(define (problem p) (:fixtures table - table) (:objects a_1 A_2 - a b_1 - b) ; a remark\n"
        "(:obj_of_interest a_1) (:init (On a_1 table_x) (In b_1 a_1)) (:goal (And (On a_1 b_1) (Turnon s))))"
    )
    assert found.objects == {"a_1": "a", "a_2": "a", "b_1": "b"}
    assert found.initial == (("on", "a_1", "table_x"), ("in", "b_1", "a_1"))
    assert found.goal == (("on", "a_1", "b_1"), ("turnon", "s"))
    with pytest.raises(SubstrateError, match="KeyError"):
        describe("(define (problem p))")


def test_scenes_are_described_as_the_embedded_catalogue_describes_libero(
    catalogue: InstalledCatalogue,
) -> None:
    pro = catalogue.variations("pro")
    assert Counter(one.category for one in pro) == dict.fromkeys((one.category for one in pro), 40)
    for one in pro:
        if one.category == "camera_view_angle" and one.suite in ("libero_spatial", "libero_object"):
            ours, embedded = catalogue.metadata(one), task_metadata(one.suite, one.index)
            assert (ours.objects, ours.fixtures) == (embedded.objects, embedded.fixtures)
            assert ours.placements == embedded.placements
            assert ours.goal == embedded.goal
            assert eligible_events(ours) == eligible_events(embedded)


def test_what_libero_pro_adds_is_reserved(catalogue: InstalledCatalogue) -> None:
    first = next(one for one in catalogue.variations("pro") if one.category == "view_occlusion")
    (added,) = catalogue.metadata(first).reserved
    assert added not in catalogue.metadata(first).distractors


def test_libero_plus_is_as_its_classification_says(catalogue: InstalledCatalogue) -> None:
    plus = catalogue.variations("plus")
    assert Counter(one.category for one in plus) == dict.fromkeys(CATEGORIES.values(), 40)
    assert {one.difficulty for one in plus} == {1, 2, 3, 4, 5}
    lacking = {one.category for one in plus if catalogue.lacks(one)}
    assert lacking == {"Background Textures", "Light Conditions"}


def test_the_command_counts_what_can_host_each_event(
    packages: tuple[Installation, Installation], capsys: pytest.CaptureFixture[str]
) -> None:
    folders = [f"--libero={found.root}" for found in packages]
    where = ["--substrate=libero", *folders, f"--libero-assets={DATA / 'assets'}"]
    assert main(["dev", "eligibility", *where]) == 0
    lines = {line[:30].strip(): line[30:].split() for line in capsys.readouterr().out.splitlines()}
    assert lines["all of pro"][:2] == ["400", "400"]
    assert lines["Light Conditions"][0] == "40"
    # As the authors' catalogue has it for every category whose scenes are LIBERO's own.
    assert lines["camera_view_angle"] == ["40", "40", "40", "40", "40", "33", "27", "12", "33"]
    assert main(["dev", "eligibility", *where, "--substrate=libero:variations=own"]) == 1


def test_a_classification_of_another_registry_is_refused(
    packages: tuple[Installation, Installation], tmp_path: Path
) -> None:
    rows = json.loads((packages[1].package / "benchmark" / "task_classification.json").read_text())
    rows["libero_goal"][7]["name"] += "1"
    other = tmp_path / "other.json"
    other.write_text(json.dumps(rows))
    with pytest.raises(ManifestError, match="not the same"):
        InstalledCatalogue(packages, other).variations("plus")
    with pytest.raises(ManifestError, match="--plus-classification"):
        InstalledCatalogue(packages, tmp_path / "missing.json").variations("plus")
    with pytest.raises(SubstrateError, match=r"LIBERO-Plus, .*doctor"):
        InstalledCatalogue(packages[:1])


def test_smoke_has_every_event_variant_and_source_once_and_no_case_that_needs_more(
    catalogue: InstalledCatalogue,
) -> None:
    cases = propose_smoke(candidates_of(catalogue))
    cells = Counter((case.source, case.event.name, case.event.variant) for case in cases)
    assert cells == {(s, event, v): 1 for s in ("plus", "pro") for event in BENCHMARK_EVENTS for v in (0, 1)}
    assert [case.case_id for case in cases] == sorted(case.case_id for case in cases)
    assert not {case.source_category for case in cases} & {"Background Textures", "Light Conditions"}
    for case in cases:
        category = case.source_category if case.source == "pro" else ""
        identity = Identity(case.source, case.suite, case.task_index, case.init_state_index, category)
        assert case.case_id == identity.case_id(case.event.name, case.event.variant)
        assert case.event.seed == identity.seed(case.event.name, case.event.variant)
        assert (case.instruction is None) == (case.source == "plus")
    suites = Counter((case.source, case.suite) for case in cases)
    assert max(suites.values()) - min(suites.values()) <= 2


def test_rejected_cases_are_replaced_in_their_slot_alone(catalogue: InstalledCatalogue) -> None:
    first = {case.case_id for case in propose_smoke(candidates_of(catalogue))}
    bad = sorted(first)[::5]

    def examine(cases: Sequence[Case]) -> dict[str, Preflight]:
        problem = Preflight((Problem("clearance", "too close"),))
        return {case.case_id: problem if case.case_id in bad else PASSED for case in cases}

    release = build_genuine(examine, catalogue, ["smoke"])
    assert list(release.tracks) == ["smoke"]
    used = {case.case_id for case in release.tracks["smoke"]}
    assert not used & set(bad)
    assert release.rejected.keys() == set(bad)
    assert release.sights.keys() == used
    assert not release.unexamined


def test_where_a_suite_has_no_room_for_an_event_the_next_one_is_tried(catalogue: InstalledCatalogue) -> None:
    def examine(cases: Sequence[Case]) -> dict[str, Preflight]:
        problem = Preflight((Problem("settling", "falls off the table"),))
        return {
            case.case_id: problem
            if (case.event.name, case.suite) == ("distractor_burst", "libero_10")
            else PASSED
            for case in cases
        }

    release = build_genuine(examine, catalogue, ["smoke"])
    bursts = [case for case in release.tracks["smoke"] if case.event.name == "distractor_burst"]
    assert {case.suite for case in bursts} == {"libero_object"}
    assert len(release.rejected) <= 4 * len(SUITES)


def test_max_keeps_what_cannot_be_examined_here_and_says_so(
    catalogue: InstalledCatalogue, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("PLUS_PER_CELL", "PRO_PER_CELL"):
        monkeypatch.setattr(case_selection, name, 1)
        monkeypatch.setattr(verification, name, 1)
    monkeypatch.setattr(genuine_tracks, "SPLITS", {"camera": splits.camera})
    examined: list[str] = []

    def examine(cases: Sequence[Case]) -> dict[str, Preflight]:
        examined.extend(case.case_id for case in cases)
        return passing(cases)

    release = build_genuine(examine, catalogue, ["max", "smoke"])
    whole = release.tracks["max"]
    assert len(whole) == (7 + 10) * 16
    assert len(release.tracks["camera"]) == 17 * 2
    assert (
        whole.protocol["substrate"]
        == release.tracks["camera"].protocol["substrate"]
        == genuine_tracks.SUBSTRATE
    )
    # The four categories of LIBERO-PRO that need files of their own, and two of LIBERO-Plus.
    assert len(release.unexamined) == 6 * 16
    assert not set(examined) & release.unexamined.keys()
    for folder in (tmp_path / "one", tmp_path / "two"):
        write_release(build_genuine(examine, catalogue, ["smoke", "max"]), folder)
    files = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert "unexamined.tsv.gz" in files
    for name in files:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    folder = tmp_path / "one"
    assert {name: load_track(name, folder) for name in track_names(folder)} == release.tracks
    assert len((folder / CHECKSUMS).read_text().splitlines()) == len(files) - 1
    assert read_unexamined(folder) == release.unexamined
    assert read_rejected(folder) == {}
    found = verify(folder)
    assert "smoke: one case of each event, variant and source" in found
    assert f"{6 * 16} of {len(release.sights) + 6 * 16} cases not examined" in found
    assert any(re.match(r"\| Its scenes: .* \| 2 \| 16 \| 0 \|", line) for line in overview_lines(folder))


def test_only_tracks_on_genuine_scenes_are_built(catalogue: InstalledCatalogue) -> None:
    with pytest.raises(OptionError, match="track='smok' cannot be built"):
        build_genuine(passing, catalogue, ["smok"])


def test_a_genuine_track_that_was_altered_is_refused(catalogue: InstalledCatalogue, tmp_path: Path) -> None:
    release = build_genuine(passing, catalogue, ["smoke"])
    first, *others = release.tracks["smoke"]
    problem = {first.case_id: (Problem("clearance", "too close"),)}
    seed = first.record["scenario"] | {"seed": first.event.seed + 1}
    wrong: dict[str, dict[str, Any]] = {
        "not every event, variant and source": {
            "tracks": {"smoke": replace(release.tracks["smoke"], cases=tuple(others))}
        },
        "in a track, and in rejected": {"rejected": problem},
        "but not in both": {"sights": dict(list(release.sights.items())[1:])},
        "in unexamined.tsv.gz, but in no track": {"unexamined": {"another": "its models"}},
        "its identity demands": {
            "tracks": {
                "smoke": replace(
                    release.tracks["smoke"], cases=(parse_case(first.record | {"scenario": seed}), *others)
                )
            }
        },
    }
    for number, (message, change) in enumerate(wrong.items()):
        folder = tmp_path / str(number)
        write_release(replace(release, **change), folder)
        with pytest.raises(ManifestError, match=message):
            verify(folder)
