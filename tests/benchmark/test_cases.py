import copy
import json
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.documents import Json, canonical_json
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.manifests import Manifest, load_manifest, parse_manifest
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.registry import resolve_event
from pytest_libero_max.tasks.contents import task_metadata
from pytest_libero_max.worlds.contract import Entity

ENTITIES = {
    name: Entity(name, "thing", "object", f"{name}_main", support="main_table")
    for name in ("mug_1", "plate_1", "jar_1")
}


def record(event: str = "camera_shift", variant: int = 1, init: int = 4) -> Json:
    identity = Identity("libero", "libero_spatial", 3, init)
    task = task_metadata("libero_spatial", 3)
    return case_record(identity, resolve_event(event, variant, task, identity), task.name)


def document(*cases: Json) -> Json:
    return {
        "benchmark_id": "mine",
        "benchmark_version": "1.0.0",
        "protocol": {
            "arms": ["control", "intervention"],
            "query_interval": 16,
            "scoring_track": "physical_completion",
        },
        "cases": list(cases) or [record()],
    }


def altered(path: str, value: object) -> Json:
    """The document with one field of its case set, or removed where value is ``...``."""
    changed = copy.deepcopy(document())
    at = changed if path.startswith("/") else changed["cases"][0]
    *parents, last = path.strip("/").split(".")
    for key in parents:
        at = at[key]
    if value is ...:
        del at[last]
    else:
        at[last] = value
    return changed


def test_a_case_says_what_its_record_says() -> None:
    case = parse_case(record())
    assert case.case_id == "libero-spatial-t03-i04-camera_shift-d1-p195"
    assert case.item_id == "libero-spatial-t03-i04-camera_shift-v1"
    assert (case.suite, case.task_index, case.init_state_index) == ("libero_spatial", 3, 4)
    assert (case.source, case.source_category, case.difficulty) == ("libero", "Unmodified", None)
    assert (case.budget, case.policy_seed, case.instruction) == (220, 195, None)
    assert (case.event.severity, case.event.family_code, case.event.response) == ("high", "OBS", "continue")
    assert case.event.trigger == {
        "type": "on_proximity",
        "value": "akita_black_bowl_1",
        "distance_m": 0.18,
    }


@given(strategies.cases(ENTITIES))
def test_a_case_survives_its_record(case: Case) -> None:
    again = parse_case(json.loads(canonical_json(case.record)))
    assert again == case
    assert again.digest == case.digest


@given(strategies.manifests(ENTITIES))
def test_a_manifest_survives_its_file(tmp_path_factory: pytest.TempPathFactory, manifest: Manifest) -> None:
    path = tmp_path_factory.mktemp("manifest") / "manifest.json"
    path.write_text(manifest.to_json())
    loaded = load_manifest(path)
    assert loaded == manifest
    assert loaded.to_json() == path.read_text()
    assert loaded.digest == manifest.digest


@given(strategies.manifests(ENTITIES), st.randoms())
def test_the_digest_of_a_manifest_is_that_of_its_cases_in_order(manifest: Manifest, random: Random) -> None:
    document = json.loads(manifest.to_json())
    shuffled = list(document["cases"])
    random.shuffle(shuffled)
    other = parse_manifest({**document, "benchmark_id": "renamed", "cases": shuffled})
    assert (other.digest == manifest.digest) == (shuffled == document["cases"])


CORRUPT = [
    ("/benchmark_id", ..., "manifest lacks benchmark_id"),
    ("/benchmarks", 1, "unknown field 'benchmarks'. Did you mean 'benchmark_id'"),
    ("/cases", [], "cases must be a non-empty list"),
    ("/cases", [3], r"cases\[0\] must be a JSON object, not int"),
    ("/protocol.arms", ["control"], r"protocol.arms=\['control'\], but must be"),
    ("task_suite_name", "libero_spacial", "'libero_spacial'. Did you mean 'libero_spatial'"),
    ("task_suite_name", ..., "case 'libero-.*' lacks task_suite_name"),
    ("task_index", "3", "task_index='3', but must be an integer"),
    ("init_state_index", -1, "init_state_index=-1, but must be an integer of at least 0"),
    ("policy_seed", True, "policy_seed=True, but must be an integer"),
    ("substrate_difficulty", 6, "substrate_difficulty=6, but must be null or 1 to 5"),
    ("substrate_category", "", "substrate_category='', but must be a non-empty string"),
    ("scenario", None, "scenario must be a JSON object, not NoneType"),
    ("scenario.change_type", "", "change_type='', but must be a non-empty string"),
    ("scenario.change_family", 3, "change_family=3, but must be a non-empty string"),
    ("scenario.expected_response_mode", None, "expected_response_mode=None, but must be a non-empty string"),
    ("scenario.randomization.draw_id", 2, "draw_id=2, but must be 0 or 1"),
    (
        "scenario.trigger.type",
        "fixed_step",
        "type='fixed_step', but in the format of the authors every event fires 'on_proximity'",
    ),
    ("scenario.trigger.distance_m", 0, "distance_m=0, but must be a length in metres above 0"),
    ("scenario.trigger.value", "", "trigger.value='', but must be a non-empty string"),
    ("scenario.change.operation", ..., "scenario.change lacks operation"),
    ("scenario.setup", {}, "setup={}, but must be a list of changes"),
    ("scenario.extra", 1, "scenario has the unknown field 'extra'"),
    ("/protocol.extra", 1, "protocol has the unknown field 'extra'"),
    ("/protocol.query_interval", ..., "protocol lacks query_interval"),
    ("/protocol.query_interval", 0, "query_interval=0, but must be an integer of at least 1"),
    ("/protocol.query_interval", 1.5, "query_interval=1.5, but must be an integer"),
    ("/protocol.scoring_track", ..., "protocol lacks scoring_track"),
    ("/protocol.scoring_track", "intent_respons", "'intent_respons'. Did you mean 'intent_response'"),
    ("/protocol.scoring_track", "intent_response", "change_family='OBS', but protocol.scoring_track='intent"),
    ("/protocol.profile", "", "protocol.profile='', but must be a non-empty string"),
    ("timing_bucket", "mid", "timing_bucket='mid'. Did you mean 'middle'"),
    ("dynamic_phase", 3, "dynamic_phase=3, but must be a non-empty string"),
    ("task_name", None, "task_name=None, but must be a non-empty string"),
    ("substrate_variant", {"langauge": "x"}, "unknown field 'langauge'. Did you mean 'language'"),
    ("substrate_variant", {"language": "x", "bddl": "y"}, "unknown field 'bddl'. Did you mean 'bddl_file'"),
    ("substrate_variant", {"language": "x", "category": 3}, "substrate_variant.category=3, but must be"),
    ("scenario.severity", "severe", "severity='severe'. .*Known: high, low, medium"),
    ("scenario.expected_response_mode", "halt", "expected_response_mode='halt'. .*Known: continue, follow_"),
    ("scenario.safety_constraints", "none", "safety_constraints='none', but must be a list of non-empty"),
    (
        "scenario.safety_constraints",
        ["ok", ""],
        r"safety_constraints\[1\]='', but must be a non-empty string",
    ),
    ("scenario.scenario_id", "", "scenario_id='', but must be a non-empty string"),
    ("scenario.base_task_id", None, "base_task_id=None, but must be a non-empty string"),
    ("scenario.randomization.extra", 1, "randomization has the unknown field 'extra'"),
    ("scenario.randomization.sampler", ..., "randomization lacks sampler"),
    ("scenario.randomization.seed", "x", "randomization.seed='x', but must be an integer"),
    ("scenario.trigger.target_entity", "x", "trigger has the unknown field 'target_entity'"),
]


@pytest.mark.parametrize(("path", "value", "message"), CORRUPT, ids=[path for path, _, _ in CORRUPT])
def test_a_corrupt_manifest_says_what_is_wrong(path: str, value: object, message: str) -> None:
    with pytest.raises(ManifestError, match=message):
        parse_manifest(altered(path, value))


def test_an_error_names_the_case() -> None:
    with pytest.raises(ManifestError, match="case 'libero-spatial-t03-i04-camera_shift-d1-p195'"):
        parse_manifest(altered("scenario.seed", -1))


def test_a_case_id_occurs_once() -> None:
    other = {**record(init=5), "case_id": record()["case_id"]}
    with pytest.raises(ManifestError, match="occurs 2 times; ids"):
        parse_manifest(document(record(), other))


def test_a_configuration_occurs_once() -> None:
    other = {**record(), "case_id": "another name for it"}
    with pytest.raises(ManifestError, match="2 cases describe the"):
        parse_manifest(document(record(), other))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b'{"benchmark_id": ', "not a JSON document"),
        (b"", "not a JSON document"),
        (b"[]", "manifest must be a JSON object, not list"),
        (b'{"benchmark_id": NaN}', "NaN is not JSON"),
        (b"\xff\xfe", "Cannot read manifest"),
    ],
)
def test_a_damaged_file_is_named(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "broken.json"
    path.write_bytes(content)
    with pytest.raises(ManifestError, match=message) as error:
        load_manifest(path)
    assert "broken.json" in str(error.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ManifestError, match=r"manifest .*nowhere\.json"):
        load_manifest(tmp_path / "nowhere.json")


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=4,
)


Route = tuple[str | int, ...]


def places(value: object, path: Route = ()) -> list[Route]:
    """The path of every value inside a document."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(place for key, item in inside for place in places(item, (*path, key)))]


@given(st.sampled_from(places(document())), JSON)
@settings(max_examples=200)
def test_whatever_stands_in_a_manifest_it_is_read_or_refused(path: Route, value: object) -> None:
    changed = {"top": document()}
    *parents, last = ("top", *path)
    at: Any = changed
    for key in parents:
        at = at[key]
    at[last] = value
    try:
        manifest = parse_manifest(changed["top"])
    except ManifestError:
        return
    for case in manifest:
        assert type(case.event.variant) is int
        assert type(case.event.trigger["distance_m"]) is float
        assert parse_case(case.record) == case


@pytest.mark.parametrize("draw", [True, 1.0, "1", None, [1]])
def test_a_variant_is_the_number_zero_or_one(draw: object) -> None:
    with pytest.raises(ManifestError, match=r"draw_id=.* 0 or 1"):
        parse_manifest(altered("scenario.randomization.draw_id", draw))


def test_a_document_nested_too_deep_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "deep.json"
    path.write_text("[" * 100_000)
    with pytest.raises(ManifestError, match=r"deep\.json: not a"):
        load_manifest(path)
