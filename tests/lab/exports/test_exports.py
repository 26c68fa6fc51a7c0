from __future__ import annotations

import hashlib
import json
import uuid
from pathlib import Path

import jsonschema
import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.cli import main
from pytest_libero_max.lab.exports import every_eval_ever
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore
from tests.report.made_up import PROVENANCE, error_of, plan, record_of
from tests.report.test_stopped_report import stopped_run

STARTED = "2026-01-02T03:04:05+00:00"

TEXT, NUMBER = {"type": "string", "minLength": 1}, {"type": "integer", "minimum": 0}


def closed(required: Json, optional: Json | None = None) -> Json:
    """The schema of an object with these fields and no others."""
    return {
        "type": "object",
        "required": [*required],
        "properties": required | (optional or {}),
        "additionalProperties": False,
    }


STATUSES = ("passed", "failed", "skipped", "pending", "other")
CTRF = closed(
    {
        "reportFormat": {"const": "CTRF"},
        "specVersion": {"type": "string", "pattern": r"^[0-9]+\.[0-9]+\.[0-9]+$"},
        "results": closed(
            {
                "tool": closed({"name": TEXT}, {"version": TEXT}),
                "summary": closed(dict.fromkeys(("tests", *STATUSES, "start", "stop"), NUMBER)),
                "tests": {
                    "type": "array",
                    "items": closed(
                        {"name": TEXT, "status": {"enum": [*STATUSES]}, "duration": NUMBER},
                        {
                            "suite": {"type": "array", "minItems": 1, "items": TEXT},
                            "message": TEXT,
                            "rawStatus": TEXT,
                            "extra": {"type": "object"},
                        },
                    ),
                },
            },
            {
                "environment": closed(
                    {}, {"appName": TEXT, "testEnvironment": TEXT, "extra": {"type": "object"}}
                )
            },
        ),
    },
    {"generatedBy": TEXT},
)
INSTANCE = closed(
    {
        "schema_version": {"const": "0.3.0"},
        **dict.fromkeys(("evaluation_id", "model_id", "evaluation_name", "sample_id"), TEXT),
        "interaction_type": {"const": "agentic"},
        "input": closed({"raw": TEXT, "reference": {"type": "array", "items": TEXT}}),
        "answer_attribution": {"type": "array"},
        "evaluation": closed(
            {
                "score": {"type": "number"},
                "is_correct": {"type": "boolean"},
                "num_turns": {"type": "integer", "minimum": 1},
            }
        ),
        "messages": {
            "type": "array",
            "minItems": 1,
            "items": closed({"turn_idx": NUMBER, "role": TEXT}, {"content": TEXT}),
        },
    },
    {"output": {"type": "null"}, "metadata": {"type": "object", "additionalProperties": TEXT}},
)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run with a regression, a pair kept, an error, and a pair that was not played."""
    pairs = [structs.replace(pair, task="libero_spatial/0") for pair in plan()[:4]]
    store = PairStore(tmp_path / "run", Run(tuple(pairs), PROVENANCE | {"started": STARTED}))
    store.append(record_of(pairs[0], True, False))
    store.append(record_of(pairs[1], True, True))
    store.append(error_of(pairs[2]))
    store.close()
    return tmp_path / "run"


def _written(run: Path, name: str, *words: str) -> str:
    file = run.parent / name
    assert main(["report", str(run), f"--export={name}={file}", *words]) == 0
    return file.read_text()


def test_ctrf_has_a_test_for_each_planned_pair_and_each_gate(run: Path) -> None:
    document = json.loads(_written(run, "ctrf", "--gate=planned > 3", "--gate=planned > 100"))
    jsonschema.validate(document, CTRF)
    results = document["results"]
    tests = {test["name"]: test for test in results["tests"]}
    first, second, third, fourth = (pair.item_id for pair in plan()[:4])
    assert [tests[name]["status"] for name in (first, second, third, fourth)] == [
        "passed",
        "passed",
        "failed",
        "pending",
    ]
    assert tests[first]["rawStatus"] == tests[first]["extra"]["outcome"] == "regression"
    assert tests[first]["extra"]["cause"] == "not_recorded"
    assert tests[first]["extra"]["replay"].endswith(f"-k {first}")
    assert tests[first]["duration"] == 1250
    assert tests[third]["message"] == "SimulatorError: qpos is not finite"
    assert tests["gate[planned > 3]"]["status"] == "passed"
    assert tests["gate[planned > 100]"]["status"] == "failed"
    assert "planned > 100: failed" in tests["gate[planned > 100]"]["message"]
    summary = results["summary"]
    assert summary["tests"] == len(tests) == 6
    assert sum(summary[status] for status in STATUSES) == 6
    assert summary["failed"] == 2
    assert (summary["start"], summary["stop"]) == (1767323045000, 1767323047500)


def _two_files(run: Path) -> tuple[Path, Path]:
    folder = run.parent / "exported"
    assert main(["report", str(run), f"--export=every-eval-ever={folder}"]) == 0
    whole, instances = sorted(folder.rglob("*.json*"))
    return whole, instances


def test_every_eval_ever_has_an_instance_for_each_arm_of_a_measured_pair(run: Path) -> None:
    _, instances = _two_files(run)
    lines = [json.loads(line) for line in instances.read_text().splitlines()]
    for line in lines:
        jsonschema.validate(line, INSTANCE)
    found = {(line["sample_id"], line["metadata"]["arm"]): line["evaluation"] for line in lines}
    first, second = (pair.item_id for pair in plan()[:2])
    assert {key: one["is_correct"] for key, one in found.items()} == {
        (first, "base"): True,
        (first, "dynamic"): False,
        (second, "base"): True,
        (second, "dynamic"): True,
    }
    assert found[first, "base"]["num_turns"] == 18
    assert len({line["evaluation_id"] for line in lines}) == 1


def test_every_eval_ever_has_the_rates_of_the_arms_and_the_place_of_the_instances(run: Path) -> None:
    whole, instances = _two_files(run)
    document = json.loads(whole.read_text())
    rates = {one["evaluation_name"]: one["score_details"] for one in document["evaluation_results"]}
    assert [one["score"] for one in rates.values()] == [1.0, 0.5]
    interval = rates["libero-max track smoke dynamic"]["uncertainty"]["confidence_interval"]
    assert (interval["lower"], interval["upper"]) == pytest.approx((0.0126, 0.9874), abs=1e-4)
    detailed = document["detailed_evaluation_results"]
    assert detailed["checksum"] == hashlib.sha256(instances.read_bytes()).hexdigest()
    assert detailed["total_rows"] == 4
    assert instances == run.parent / "exported" / detailed["file_path"]
    assert whole.name == instances.name.replace("_samples.jsonl", ".json")
    assert uuid.UUID(whole.stem).version == 4
    first = json.loads(instances.read_text().splitlines()[0])
    assert document["evaluation_id"] == first["evaluation_id"]
    assert document["model_info"]["id"] == first["model_id"]


def test_every_eval_ever_refuses_a_run_without_a_measured_pair(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    PairStore(tmp_path / "run", Run(tuple(plan()[:1]), PROVENANCE)).close()
    assert main(["report", str(tmp_path / "run"), f"--export=every-eval-ever={tmp_path / 'x'}"]) == 1
    assert "No pair" in capsys.readouterr().err


def test_robostats_own_reader_finds_the_same_change(run: Path) -> None:
    robostats = pytest.importorskip("robostats", reason="pip install --no-deps -r .ci/peers.txt")
    _written(run, "robostats")
    names = ("policy_id", "task_id", "success", "seed", "run_id")
    records = robostats.load_jsonl(
        run.parent / "robostats", protocol=robostats.Protocol(), **{f"{name}_field": name for name in names}
    )
    arms = (records.filter(policy_id=f"scripted/{arm}") for arm in ("dynamic", "base"))
    result = robostats.compare(robostats.pair(*arms))
    assert result.delta == -0.5


def test_robostats_joins_the_arms_of_a_case(run: Path) -> None:
    lines = [json.loads(line) for line in _written(run, "robostats").splitlines()]
    of_arm = {
        arm: {
            line["scenario_id"]: line["success"] for line in lines if line["policy_id"] == f"scripted/{arm}"
        }
        for arm in ("base", "dynamic")
    }
    assert len(lines) == 4
    assert [*of_arm["base"]] == [*of_arm["dynamic"]]
    assert [*of_arm["base"].values()] == [True, True]
    assert sorted(of_arm["dynamic"].values()) == [False, True]
    for line in lines:  # every field of the reader's schema, null where there is none
        assert {"task_id", "episode_idx", "seed", "success_detail", "run_id"} <= line.keys()
        assert line["schema_version"] == 2


def test_another_format_is_refused_with_the_closest_one(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", str(run), f"--export=tensorbord={run / 'x'}"]) == 1
    assert "'tensorboard'" in capsys.readouterr().err
    assert not (run / "x").exists()


def test_an_export_of_a_stopped_run_has_no_interval() -> None:
    assert "confidence_interval" not in str(every_eval_ever.files(stopped_run("smoke/stale_expert")))
