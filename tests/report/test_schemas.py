from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from importlib import resources
from pathlib import Path

import jsonschema
import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import compare_runs
from pytest_libero_max.report.writers.report_files import read_report, report_json, write_reports
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import read_pairs
from tests.report.made_up import (
    NEVER_TRIGGERED,
    PROVENANCE,
    error_of,
    plain,
    plan,
    record_of,
    records_of,
    run_of,
    write_run,
)


def _validator(name: str) -> jsonschema.Draft202012Validator:
    text = resources.files("pytest_libero_max.report").joinpath(f"{name}.schema.json").read_text()
    schema = json.loads(text)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    pairs = plan()
    records = [record_of(pairs[1], True, True, **NEVER_TRIGGERED), *records_of(pairs[2:])]
    run = run_of(pairs, records, errors=[error_of(pairs[0])])
    return write_run(tmp_path, replace(run, stopped=Stopped("somebody stopped it", of=len(pairs))))


def test_every_line_of_a_run_is_as_the_schema_says(folder: Path) -> None:
    validator = _validator("record")
    lines = (folder / "pairs.jsonl").read_text().splitlines()
    assert {json.loads(line)["line"] for line in lines} == {"run", "pair", "error", "stopped"}
    for line in lines:
        validator.validate(json.loads(line))


@pytest.mark.parametrize("played", [0, 1, 31, 32])
def test_every_report_is_as_the_schema_says(played: int) -> None:
    pairs = plan()
    report = build_report(records_of(pairs[:played]), [], pairs, PROVENANCE)
    _validator("report").validate(json.loads(report_json(report)))
    assert next(iter(plain(report))) == "schema_version"


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("overall", "base_success", "value"), float("nan")),
        (("overall", "base_success", "value"), 1.2),
        (("overall", "outcomes", "regression"), -1),
        (("headline", "status"), "fine"),
        (("pairs", "planet"), {}),
    ],
)
def test_the_schema_refuses_what_a_report_never_holds(path: tuple[str, ...], value: object) -> None:
    pairs = plan()
    report = build_report(records_of(pairs), [], pairs, PROVENANCE)
    written = plain(report)
    place = written
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    # JSON Schema cannot name NaN; the writer refuses it.
    with pytest.raises((jsonschema.ValidationError, ValueError)):
        _validator("report").validate(json.loads(json.dumps(written, allow_nan=False)))


def test_the_written_report_can_be_computed_from_the_pairs_alone(folder: Path) -> None:
    report, paths = write_reports(folder)
    assert [path.name for path in paths] == ["pairs.jsonl", "report.json", "report.md", "report.html"]
    run = read_pairs(folder)
    assert report == build_report(run.records, run.errors, plan(), PROVENANCE, run.stopped)
    assert read_report(folder) == report
    assert json.loads(report_json(report)) == plain(report)
    before = (folder / "report.json").read_bytes()
    write_reports(folder)
    assert (folder / "report.json").read_bytes() == before
    assert not list(folder.glob("*.partial"))


def test_every_comparison_is_as_the_schema_says() -> None:
    pairs = plan()
    runs = {name: run_of(pairs, records_of(pairs, seed)) for name, seed in (("a", 1), ("b", 2), ("c", 1))}
    comparison = compare_runs(runs)
    assert len(plain(comparison)["contrasts"]) == 3
    assert next(iter(plain(comparison))) == "schema_version"
    _validator("comparison").validate(plain(comparison))


def _fields(schema: Json, path: str = "") -> Iterator[tuple[str, Json]]:
    """Every property of a schema by its path, those of its definitions included."""
    for name, field in schema.get("properties", {}).items():
        yield f"{path}.{name}", field
        yield from _fields(field, f"{path}.{name}")
    for part in ("items", "additionalProperties"):
        if isinstance(schema.get(part), dict):
            yield from _fields(schema[part], f"{path}.*")
    for part in ("oneOf", "anyOf", "allOf"):
        for option in schema.get(part, []):
            yield from _fields(option, path)
    for name, definition in schema.get("$defs", {}).items():
        yield from _fields(definition, f"${name}")


@pytest.mark.parametrize("name", ["report", "comparison", "record"])
def test_every_field_is_described(name: str) -> None:
    schema = _validator(name).schema
    assert isinstance(schema, dict)
    fields = dict(_fields(schema))
    assert len(fields) > 50
    assert [path for path, field in fields.items() if len(field.get("description", "")) < 8] == []


@pytest.mark.parametrize("name", ["report", "comparison"])
def test_a_definition_that_two_schemas_share_is_the_same(name: str) -> None:
    definitions = _validator(name).schema.get("$defs", {})
    for other in ("report", "comparison"):
        for key, definition in _validator(other).schema.get("$defs", {}).items():
            assert definitions.get(key, definition) == definition, f"{key} of {name} and of {other}"
