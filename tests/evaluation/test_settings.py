"""A setting is one field: whatever asks what a run was played with follows from its declaration."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, cast

import msgspec
import pytest

from pytest_libero_max.benchmark.structs import Share
from pytest_libero_max.benchmark.text_values import fraction, positive
from pytest_libero_max.errors import OptionError, OtherRunError, ReportError
from pytest_libero_max.evaluation.evaluate import evaluate
from pytest_libero_max.evaluation.resolving import resolve
from pytest_libero_max.evaluation.settings import GONE, OPTIONS, Settings
from pytest_libero_max.runs import protocol
from pytest_libero_max.runs.agreement import Agreement
from pytest_libero_max.runs.comparability import measurement_differences, names, require_names
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.protocol import Noise, protocol_words
from pytest_libero_max.runs.replay_command import replay_of
from pytest_libero_max.runs.setting import Option, Recorded, options_of, setting
from pytest_libero_max.runs.store import StoredRun, read_pairs
from pytest_libero_max.substrates.contract import ChosenSubstrate, SubstrateOptions

USUAL = {option.field: option.default for option in OPTIONS}


@dataclass(frozen=True)
class Windy(Settings):
    """The settings with one more, declared as the others are."""

    wind: float = setting(
        "SPEED",
        "Speed of the wind, m/s",
        fraction,
        default=0.0,
        recorded=Recorded("protocol", Share, usual=0.0, option="{:.2f}".format),
    )


@pytest.fixture(autouse=True)
def declared(monkeypatch: pytest.MonkeyPatch) -> None:
    """The field is there as if the class itself declared it."""
    monkeypatch.setattr(protocol, "DECLARED", (*protocol.DECLARED, options_of(Windy)[-1]))


@pytest.fixture(scope="module")
def published() -> StoredRun:
    return read_pairs(Path(__file__).parents[2] / "reports" / "smoke" / "stale_expert")


def windy(speed: float) -> Windy:
    plain = resolve({**USUAL, "policy": "noop", "manifest": "cases.json"}, Path.cwd())
    return Windy(**{item.name: getattr(plain, item.name) for item in fields(plain)}, wind=speed)


def run_with(published: StoredRun, **settings: object) -> Run:
    changed = {**published.run.provenance["protocol"], **settings}
    return Run(published.run.planned, {**published.run.provenance, "protocol": changed})


def test_the_header_names_how_the_policy_is_asked_and_what_is_around_it() -> None:
    plain = resolve({**USUAL, "policy": "noop", "manifest": "cases.json"}, Path.cwd())
    wrappers = {"restore": "gated", "adaptive": "image"}
    asked = replace(plain, horizon=8, query_interval=4, wrap=wrappers)
    assert asked.extras == ", horizon 8, query interval 4, wrap restore:gated,adaptive:image"


def test_a_new_setting_is_said_by_header_record_and_provenance_unless_it_is_the_usual() -> None:
    still, storm = windy(0.0), windy(0.5)
    assert (still.extras, still.played) == ("", {})
    assert "wind" not in still.recorded("protocol")
    assert storm.extras == ", wind 0.5"
    assert storm.played == {"wind": "0.5"}
    assert storm.recorded("protocol") == {**still.recorded("protocol"), "wind": 0.5}
    assert list(protocol_words(storm.recorded("protocol")).values()) == ["wind 0.5"]


def test_a_new_setting_counts_for_agreement(published: StoredRun) -> None:
    still, storm = published.run, run_with(published, wind=0.5)
    record = published.records[0]

    def played(speed: str) -> Any:
        fingerprints = {**record.fingerprints, "wind": speed}
        return msgspec.structs.replace(record, fingerprints=fingerprints)

    Agreement(storm).add(played("0.5"), "here")
    for run, pair in ((storm, played("0.1")), (storm, record), (still, played("0.5"))):
        with pytest.raises(OtherRunError, match=r"fingerprints\.wind"):
            Agreement(run).add(pair, "here")


def test_a_new_setting_counts_for_comparison_and_replay_and_is_checked(published: StoredRun) -> None:
    still, storm = published.run, run_with(published, wind=0.5)
    assert measurement_differences(still, storm) == ["protocol.wind: 0.0, 0.5"]
    assert "wind" in names()
    require_names(["wind"])
    assert "--libero-max-wind=0.50" in replay_of(storm.provenance)
    with pytest.raises(ReportError, match=r"protocol\.wind='strong'"):
        Run.from_dict(run_with(published, wind="strong").to_dict())


def test_a_setting_of_another_version_is_taken_by_its_name(published: StoredRun) -> None:
    rainy = run_with(published, rain="heavy")
    assert measurement_differences(published.run, rainy) == ["protocol.rain: None, 'heavy'"]
    assert "--libero-max-rain=heavy" in replay_of(rainy.provenance)


def test_a_setting_in_several_fields_is_one_option(published: StoredRun) -> None:
    (noise,) = (option for option in OPTIONS if option.name == "noise")
    assert noise.parse("floor:4,sham:0.5") == Noise(sham=0.5, floor=4)
    settings = resolve({**USUAL, "policy": "noop", "manifest": "a.json", "noise": Noise(0.5, 4)}, Path.cwd())
    recorded = settings.recorded("protocol")
    assert (recorded["noise_floor"], recorded["sham"], settings.played) == (4, 0.5, {})
    command = replay_of(run_with(published, **recorded).provenance)
    assert [word for word in command if "noise" in word] == ["--libero-max-noise=floor:4,sham:0.5"]
    assert {"--libero-max-limit", "--libero-max-track"} & {word.partition("=")[0] for word in command}


def test_substrates_are_spelled_as_they_are_read() -> None:
    (option,) = (option for option in OPTIONS if option.name == "substrate")
    own = ChosenSubstrate("libero", SubstrateOptions(semantics="corrected", variations="own"))
    assert option.parse("libero:variations=own,semantics=corrected") == own
    assert str(own) == "libero:semantics=corrected,variations=own"
    assert option.parse(str(own)) == own
    for text, words in (
        ("libero:semantics=right", "Known: corrected, published"),
        ("libero:colour=red", "colour is unknown"),
        ("embedded:semantics=corrected", "semantics is unknown. Known: images"),
        ("embedded:images=3", "Known: 1, 2"),
        ("tiny:images=1", "takes no options, but"),
    ):
        with pytest.raises(OptionError, match=words):
            option.read(text, option.flag)


def test_an_option_is_its_field() -> None:
    option = Option("new-thing", "N", "", positive)
    assert (option.flag, option.field, option.key) == (
        "--libero-max-new-thing",
        "new_thing",
        "libero_max_new_thing",
    )
    with pytest.raises(OptionError, match="new_thing='x': expected an integer"):
        option.read("x", "new_thing")
    assert [item.name for item in fields(Settings)] == [option.field for option in OPTIONS]


def test_arguments_of_before_are_answered_with_those_of_now() -> None:
    gone = {name: f"spelled {GONE[name.replace('_', '-')]}" for name in ("noise_floor", "sham", "restore")}
    others = {"gate": "spelled gates", "output": "spelled folder"}
    session = dict.fromkeys(("film", "film_limit", "ray_gpus"), "a session of pytest")
    for name, words in {**gone, **others, **session}.items():
        with pytest.raises(OptionError, match=words):
            evaluate("noop", **cast("Any", {name: 1}))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sham", "without its value"),
        ("sham:0.5,sham:0.2", "given twice"),
        ("floor:0", "at least 1"),
        ("flor:2", "Did you mean 'floor'"),
    ],
)
def test_values_by_name_say_what_is_wrong_with_them(text: str, words: str) -> None:
    (noise,) = (option for option in OPTIONS if option.field == "noise")
    with pytest.raises(OptionError, match=words):
        noise.read(text, "noise")
    assert noise.read("sham:0.5, floor:2", "noise") == Noise(0.5, 2)
    assert noise.read("none", "noise") == Noise()


@pytest.mark.parametrize(
    ("field", "text"), [("timeout", "none"), ("ray", "auto,none"), ("substrate", "libero:none")]
)
def test_none_is_a_value_of_what_an_ini_file_can_add_alone(field: str, text: str) -> None:
    (option,) = (option for option in OPTIONS if option.field == field)
    with pytest.raises(OptionError, match="'none'"):
        option.read(text, field)


def test_a_replay_selects_from_what_the_run_selected_from() -> None:
    run = read_pairs(Path(__file__).parents[2] / "reports" / "smoke" / "stale_expert").run
    asked = [
        "--libero-max-only-installed",
        "--libero-max-suites=libero_goal,libero_10",
        "--libero-max-limit=2",
    ]
    chosen = {**run.provenance["selection"], "asked": asked}
    protocol = {**run.provenance["protocol"], "noise_floor": 1}
    words = replay_of({**run.provenance, "selection": chosen, "protocol": protocol})
    assert {*asked[:2]} <= {*words}


def test_what_is_needed_every_day_fits_on_a_screen_and_all_in_a_hand() -> None:
    by_group = Counter(option.group for option in OPTIONS)
    assert by_group["everyday"] <= 14
    assert len(OPTIONS) <= 40
    assert {option.group for option in OPTIONS if option.recorded} == {"protocol"}
