"""The released scenarios, regenerated from the released task catalogue."""

import json
import os
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.records import scenario_record
from pytest_libero_max.changes import change_from_dict
from pytest_libero_max.events.registry import eligible_events, resolve_event
from pytest_libero_max.tasks.contents import TaskMetadata, task_metadata
from tests.makers.construction.official_catalog import metadata_from_catalog

REPOSITORY = Path(__file__).resolve().parents[3]
OFFICIAL = Path(os.environ.get("LIBERO_MAX_OFFICIAL", REPOSITORY.parent / "shared" / "official"))
MANIFEST = OFFICIAL / "libero_max_pro_model_comparison_800.json"
CATALOG = OFFICIAL / "pro_task_catalog.json"

Tasks = dict[tuple[str, str, int], TaskMetadata]

pytestmark = pytest.mark.skipif(
    not (MANIFEST.is_file() and CATALOG.is_file()),
    reason="the released manifests are not here; set LIBERO_MAX_OFFICIAL to their folder",
)


@pytest.fixture(scope="module")
def catalog() -> list[Json]:
    rows: list[Json] = json.loads(CATALOG.read_text())["tasks"]
    return rows


@pytest.fixture(scope="module")
def tasks(catalog: list[Json]) -> Tasks:
    keys = ((row["pro_category"], row["task_suite_name"], row["task_index"]) for row in catalog)
    return dict(zip(keys, map(metadata_from_catalog, catalog), strict=True))


def spelled(value: object) -> str:
    return json.dumps(value, sort_keys=True)  # tells -0.0 from 0.0 and 1 from 1.0


def regenerated(case: Case, tasks: Tasks) -> Json:
    identity = Identity("pro", case.suite, case.task_index, case.init_state_index, case.source_category)
    task = tasks[case.source_category, case.suite, case.task_index]
    return scenario_record(identity, resolve_event(case.event.name, case.event.variant, task, identity))


def test_every_released_scenario_is_regenerated(tasks: Tasks) -> None:
    manifest = load_manifest(MANIFEST)
    assert len(manifest) == 800
    differing = [
        case.case_id
        for case in manifest
        if spelled(regenerated(case, tasks)) != spelled(case.record["scenario"])
    ]
    assert differing == []


def test_every_released_case_id_is_regenerated() -> None:
    for case in load_manifest(MANIFEST):
        identity = Identity("pro", case.suite, case.task_index, case.init_state_index, case.source_category)
        assert identity.case_id(case.event.name, case.event.variant) == case.case_id


def test_every_released_change_survives_reading_and_writing() -> None:
    for case in load_manifest(MANIFEST):
        for raw in (case.event.change, *case.event.setup):
            assert spelled(change_from_dict(raw).to_dict()) == spelled(raw)


def test_the_manifest_keeps_its_bytes() -> None:
    manifest = load_manifest(MANIFEST)
    assert manifest.to_json() == MANIFEST.read_text()
    assert manifest.recognition is not None
    assert manifest.recognition.identical


def test_derived_metadata_equals_the_catalogue(catalog: list[Json]) -> None:
    for row in catalog:
        task = metadata_from_catalog(row)
        assert list(task.goal_entities) == row["goal_entity_order"]
        assert list(task.distractors) == row["distractor_objects"]
        assert task.primary_target == row["primary_target"]
        assert task.trigger_entity == row["trigger_entity"]
        assert task.primary_receptacle == row["primary_receptacle"]
        assert task.planar(task.primary_target) == row["supports_target_relocation"]
        assert task.planar(task.primary_receptacle) == row["supports_receptacle_relocation"]
        assert list(eligible_events(task)) == row["eligible_change_types"]
        for name, placement in row["initial_placements"].items():
            assert task.support(name) == placement["support_entity"]


def test_the_embedded_task_table_says_what_the_catalogue_says(tasks: Tasks) -> None:
    for suite in ("libero_spatial", "libero_object"):
        for index in range(10):
            ours, theirs = task_metadata(suite, index), tasks["semantic", suite, index]
            assert (ours.objects, ours.fixtures) == (theirs.objects, theirs.fixtures)
            assert ours.objects_of_interest == theirs.objects_of_interest
            assert ours.placements == theirs.placements
            assert ours.goal_entities == theirs.goal_entities
            assert ours.distractors == theirs.distractors
            assert ours.obstacle_candidates == theirs.obstacle_candidates
            assert eligible_events(ours) == eligible_events(theirs)
            assert ours.name == theirs.name
