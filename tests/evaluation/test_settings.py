"""A setting is one field: whatever asks what a run was played with follows from its declaration."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import msgspec
import pytest

from pytest_libero_max.errors import OptionError, OtherRunError
from pytest_libero_max.evaluation import option_values as read
from pytest_libero_max.evaluation.resolving import resolve
from pytest_libero_max.evaluation.settings import OPTIONS, Option, Recorded, Settings, setting
from pytest_libero_max.runs.agreement import Agreement
from pytest_libero_max.runs.comparability import measurement_differences
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.protocol import protocol_words
from pytest_libero_max.runs.replay_command import replay_of
from pytest_libero_max.runs.store import read_pairs


@dataclass(frozen=True)
class Windy(Settings):
    """The settings with one more, declared as the others are."""

    wind: float = setting(
        "SPEED",
        "Speed of the wind, m/s",
        read.fraction,
        default=0.0,
        recorded=Recorded("protocol", usual=0.0),
    )


def windy(speed: float) -> Windy:
    values: dict[str, Any] = {option.field: option.default for option in OPTIONS}
    plain = resolve({**values, "policy": "noop", "manifest": "cases.json"}, Path.cwd())
    return Windy(**{item.name: getattr(plain, item.name) for item in fields(plain)}, wind=speed)


def test_a_new_setting_is_said_by_header_record_and_provenance_unless_it_is_the_usual() -> None:
    still, storm = windy(0.0), windy(0.5)
    assert (still.extras, still.played) == ("", {})
    assert "wind" not in still.recorded("protocol")
    assert storm.extras == ", wind 0.5"
    assert storm.played == {"wind": "0.5"}
    assert storm.recorded("protocol") == {**still.recorded("protocol"), "wind": 0.5}
    assert list(protocol_words(storm.recorded("protocol")).values()) == ["wind 0.5"]


def test_a_new_setting_counts_for_agreement_comparison_and_replay() -> None:
    published = read_pairs(Path(__file__).parents[2] / "reports" / "smoke" / "stale_expert")
    record = published.records[0]
    protocol = published.run.provenance["protocol"]
    storm = Run(published.run.planned, {**published.run.provenance, "protocol": {**protocol, "wind": 0.5}})
    assert "--libero-max-wind=0.5" in replay_of(storm.provenance)
    assert measurement_differences(published.run, storm) == ["protocol.wind: None, 0.5"]

    def played(speed: str) -> Any:
        fingerprints = {**record.fingerprints, "wind": speed}
        return msgspec.structs.replace(record, fingerprints=fingerprints)

    Agreement(storm).add(played("0.5"), "here")
    with pytest.raises(OtherRunError, match=r"fingerprints\.wind"):
        Agreement(storm).add(played("0.1"), "here")


def test_an_option_is_its_field() -> None:
    option = Option("new-thing", "N", "", read.positive)
    assert (option.flag, option.field, option.key) == (
        "--libero-max-new-thing",
        "new_thing",
        "libero_max_new_thing",
    )
    with pytest.raises(OptionError, match="new_thing='x': expected an integer"):
        option.read("x", "new_thing")
    assert [item.name for item in fields(Settings)] == [option.field for option in OPTIONS]


def test_what_is_needed_every_day_fits_on_a_screen() -> None:
    by_group = Counter(option.group for option in OPTIONS)
    assert by_group["everyday"] <= 14
    assert {option.group for option in OPTIONS if option.recorded} == {"protocol"}
