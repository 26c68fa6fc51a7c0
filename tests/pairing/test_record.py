from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import RECORD_VERSION, PairError, PairRecord
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.runs.store import read_pairs
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.mujoco_line import of_the_reference

from .actors import Approaching, make_case

VERSION_1 = Path(__file__).parent / "records" / "version_1.jsonl"
"""Pairs in version 1 of the record: two with a second Base, an event that never fired, an error."""


def stored() -> list[Json]:
    lines = [json.loads(line) for line in VERSION_1.read_text().splitlines()]
    return [line for line in lines if line.pop("line") == "pair"]


def test_a_run_of_version_1_is_still_read() -> None:
    run = read_pairs(VERSION_1)
    assert (len(run.records), len(run.errors), len(run.run.planned)) == (4, 1, 5)
    assert run.errors[0].schema_version == RECORD_VERSION
    assert [record.triggered for record in run.records] == [True, True, True, False]


@pytest.mark.parametrize("number", range(4))
def test_the_pair_of_a_record_of_version_1_is_what_it_was(number: int) -> None:
    old = stored()[number]
    record = PairRecord.from_dict(old)
    new = record.to_dict()
    assert new["schema_version"] == RECORD_VERSION
    for name, value in old.items():
        if name != "schema_version":
            assert (new[name] if name in new else getattr(record, name)) == value, name
    assert PairRecord.from_dict(json.loads(json.dumps(new))) == record


@of_the_reference
def test_the_same_pair_today_says_the_same() -> None:
    old = PairRecord.from_dict(stored()[1])
    policy = Approaching(wait=3, horizon=4, interval=4)
    short = make_case("sensor_noise_onset")
    case = Case(**{field.name: getattr(short, field.name) for field in fields(short)})  # of 220 steps
    new = play_pair(case, TinyWorld(), policy)
    assert old.event == new.event
    for name in (
        "trigger_step",
        "base_queries",
        "dynamic_queries",
        "base_digest",
        "dynamic_digest",
        "evidence",
    ):
        assert getattr(old, name) == getattr(new, name)
    assert old.arms["dynamic"].queries == new.arms["dynamic"].queries
    assert old.arms["dynamic"].firings == new.arms["dynamic"].firings


def renamed(values: Json) -> None:
    values["event_name"] = values.pop("event")


def in_arm(values: Json) -> None:
    values["arms"]["base"]["sucess"] = True


def without_proof(values: Json) -> None:
    del values["arms"]["dynamic"]["firings"][0]["prefix_proof"]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (renamed, "pair record has the unknown field 'event_name'. Did you mean 'event'"),
        (in_arm, "arm has the unknown field 'sucess'. Did you mean 'success'"),
        (without_proof, "Firing None lacks prefix_proof"),
        (
            lambda values: values.update(schema_version=4),
            "schema_version=4 of a pair record, .* reads 1, 2 and 3",
        ),
        (lambda values: values.update(schema_version=True), "schema_version=True"),
    ],
)
def test_a_record_that_cannot_be_read_says_why(damage: Any, message: str) -> None:
    values = PairRecord.from_dict(stored()[0]).to_dict()
    damage(values)
    with pytest.raises(ReportError, match=message):
        PairRecord.from_dict(values)


def test_a_record_of_version_1_that_lacks_a_field_says_which() -> None:
    values = stored()[0]
    del values["stale_actions"]
    with pytest.raises(ReportError, match="lacks stale_actions"):
        PairRecord.from_dict(values)
    with pytest.raises(ReportError, match="schema_version=0 of a pair error"):
        PairError.from_dict({"schema_version": 0})


def test_an_arm_that_was_not_played_is_named() -> None:
    record = PairRecord.from_dict(stored()[0])
    with pytest.raises(ReportError, match=r"was not played in an arm 'dynamics'\. Did you mean 'dynamic'"):
        record.arm("dynamics")


def test_clipped_components_are_counted_in_every_arm() -> None:
    class Strong(Approaching):
        def predict(self, observation: Any, query: Any) -> Any:
            return super().predict(observation, query) * [1.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0]

    record = play_pair(make_case(), TinyWorld(), Strong())
    for arm in record.arms.values():
        assert arm.clipped_components == 2 * (arm.steps or 0)
        assert arm.clipped_share == pytest.approx(2 / 7)
    assert play_pair(make_case(), TinyWorld(), Approaching()).arms["base"].clipped_components == 0
