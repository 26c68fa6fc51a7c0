from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.mujoco_line import of_the_reference

from .actors import Approaching, make_case


def played() -> PairRecord:
    return play_pair(make_case(), TinyWorld(), Approaching())


@of_the_reference
def test_the_same_pair_says_the_same_as_ever() -> None:
    short = make_case("sensor_noise_onset")
    case = Case(**{field.name: getattr(short, field.name) for field in fields(short)})  # of 220 steps
    record = play_pair(case, TinyWorld(), Approaching(wait=3, horizon=4, interval=4))
    assert (record.trigger_step, record.base_queries, record.dynamic_queries) == (7, 55, 53)
    assert record.base_digest == "ce51539fe7ceaaa34ce00ed0ce34ec10687575a0b29a11abe11a03354656793f"
    assert record.dynamic_digest == "a4e0273424f52fbfe3fb0435100225bdfc36f3b6b5c3341cc45fd36acb9ef21e"
    (firing,) = record.arms["dynamic"].firings
    assert firing.prefix_proof == "b496c0d30f49f44d52f582b4d123101ad1b06836054b1f88ce5517ff518eb725"


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
        (in_arm, "arms.base has the unknown field 'sucess'. Did you mean 'success'"),
        (without_proof, r"arms.dynamic.firings\[0\] lacks prefix_proof"),
        (
            lambda values: values.update(schema_version=2),
            "schema_version=2 of a pair record, .* reads 3",
        ),
        (lambda values: values.update(schema_version=True), "schema_version=True"),
    ],
)
def test_a_record_that_cannot_be_read_says_why(damage: Any, message: str) -> None:
    values = played().to_dict()
    damage(values)
    with pytest.raises(ReportError, match=message):
        PairRecord.from_dict(values)


def test_a_record_that_lacks_a_field_says_which() -> None:
    values = played().to_dict()
    del values["arms"]["dynamic"]["stale_actions"]
    with pytest.raises(ReportError, match="lacks stale_actions"):
        PairRecord.from_dict(values)
    with pytest.raises(ReportError, match="schema_version=0 of a pair error"):
        PairError.from_dict({"schema_version": 0})


def test_an_arm_that_was_not_played_is_named() -> None:
    record = played()
    with pytest.raises(ReportError, match=r"'dynamics'.*'dynamic'"):
        record.arm("dynamics")


def test_clipped_components_are_counted_in_every_arm() -> None:
    class Strong(Approaching):
        def predict(self, observation: Any, query: Any) -> Any:
            return super().predict(observation, query) * [1.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0]

    record = play_pair(make_case(), TinyWorld(), Strong())
    for arm in record.arms.values():
        assert arm.clipped_components == 2 * arm.steps
        assert arm.clipped_share == pytest.approx(2 / 7)
    assert play_pair(make_case(), TinyWorld(), Approaching()).arms["base"].clipped_components == 0
