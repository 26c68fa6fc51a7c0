"""Environments with one mistake each: its rule finds it, and no other ``must``; sound ones keep all."""

from __future__ import annotations

from typing import Any

import pytest

from pytest_libero_max.conformance.environment.declared import DEFAULT_REFERENCE, FactoryName
from pytest_libero_max.conformance.environment.reference import SIDE, read_reference, references
from pytest_libero_max.conformance.environment.subject import EnvironmentSubject, open_environment
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination, Outcome
from pytest_libero_max.errors import OptionError
from pytest_libero_max.worlds.robot import CAMERAS
from tests.conformance import environments

RULES = rules_for("env")
GYM = {"begin": environments.from_options, "settle_steps": 10}

GALLERY: list[tuple[type[environments.LiberoShaped], str, str, dict[str, Any]]] = [
    (environments.WithoutWrist, "contract/keys", "no image of robot0_eye_in_hand", {}),
    (environments.FloatImages, "contract/keys", "float64", {}),
    (environments.ThreeValues, "contract/opens", "step() returned", {}),
    (environments.OneBuffer, "contract/aliases", "changed with later steps", {}),
    (environments.ClosedOnce, "contract/close", "the second close() raised", {}),
    (environments.Aging, "contract/reopens", "begins with another position", {}),
    (environments.SharedImages, "contract/company", "while another is open", {}),
    (environments.Settling, "starts/settle", "after 5 settle steps", GYM),
    (environments.OffByOne, "starts/state", "has the hand of state 2", {}),
    (environments.Unseeded, "starts/fixtures", "mm elsewhere", {}),
    (environments.Remembering, "starts/index", "images that differ", {}),
    (environments.Counting, "starts/count", "the second or third time", GYM),
    (environments.Upright, "images/orientation", "flipped upside down", {}),
    (environments.Mirrored, "images/orientation", "mirrored left to right", {}),
    (environments.Rotated, "images/orientation", "rotated by 180 degrees", {}),
    (environments.Bgr, "images/colours", "blue and red are exchanged", {}),
    (environments.Dark, "images/content", "mean difference", {}),
    (environments.Stale, "images/fresh", "is the image before it", {}),
    (environments.TwiceAsFast, "clock/rate", "takes 100.0 ms", {}),
    (environments.ShortEpisodes, "clock/budget", "after 76 of 80", {}),
    (environments.LongEpisodes, "clock/limit", "140 steps", GYM),
    (environments.Absolute, "actions/rest", "move the hand by", GYM),
    (environments.Swapped, "actions/directions", "+1 in x move the hand by (+0, +1", {}),
    (environments.Half, "actions/scale", "0.5", {}),
    (environments.TurningBack, "actions/rotation", "+1 about z", {}),
    (environments.ClosingAtMinusOne, "actions/gripper", "openings after -1, +1, -1", {}),
    (environments.Unbounded, "actions/range", "times as far", {}),
    (environments.WFirst, "states/quaternion", "w, x, y, z:", {}),
    (environments.Width, "states/fingers", "(0.0400, 0.0400)", {}),
    (environments.Antipodal, "states/vector", "antipodal", GYM),
    (environments.FromTheFileName, "task/instruction", "view 0 0 100", GYM),
    (environments.OtherGains, "task/follows", "from step", {}),
    (environments.NeverDone, "task/success", "not reported", {}),
    (environments.Easy, "task/success", "steps early", {}),
    (environments.Noisy, "repeats/same", "another position by", {}),
]


def examine(environment: type[environments.LiberoShaped], **fields: Any) -> dict[str, Outcome]:
    subject = EnvironmentSubject(environments.declared(environment, **fields))
    outcomes = Examination(lambda: subject, RULES).outcomes()
    subject.abandon()
    return {outcome.rule.id.removeprefix("env/"): outcome for outcome in outcomes}


def states(outcomes: dict[str, Outcome], state: str) -> list[str]:
    return [name for name, outcome in outcomes.items() if outcome.state == state]


@pytest.mark.parametrize(
    ("environment", "fields", "unexamined"),
    [
        (environments.LiberoShaped, {}, ["clock/limit", "states/vector", "task/instruction", "starts/count"]),
        (environments.Gym, GYM, []),
        (environments.Vector, GYM, []),
    ],
)
def test_a_sound_environment_keeps_every_rule(
    environment: type[environments.LiberoShaped], fields: dict[str, Any], unexamined: list[str]
) -> None:
    outcomes = examine(environment, **fields)
    assert not states(outcomes, "broken"), [outcomes[name].broken for name in states(outcomes, "broken")]
    assert {*states(outcomes, "unexamined")} == {"repeats/process", *unexamined}


@pytest.mark.parametrize(
    ("environment", "name", "observed", "fields"), GALLERY, ids=[each[0].__name__ for each in GALLERY]
)
def test_a_mistake_breaks_its_rule_and_no_other_must(
    environment: type[environments.LiberoShaped], name: str, observed: str, fields: dict[str, Any]
) -> None:
    outcomes = examine(environment, **fields)
    assert observed in " ".join(finding.observed for finding in outcomes[name].findings)
    assert all(finding.expected and finding.cure for finding in outcomes[name].broken)
    must = {broken for broken in states(outcomes, "broken") if outcomes[broken].rule.level == "must"}
    assert must <= {name}


def test_images_that_are_drawn_are_known_again() -> None:
    subject = EnvironmentSubject(environments.declared(environments.Drawn))
    needed = (
        "contract/keys",
        "contract/opens",
        "images/orientation",
        "images/colours",
        "images/content",
        "images/fresh",
    )
    rules = [rule for rule in RULES if rule.id.removeprefix("env/") in needed]
    assert {outcome.state for outcome in Examination(lambda: subject, rules).outcomes()} == {"kept"}
    subject.abandon()


def test_another_process_finds_what_hashes_decide() -> None:
    subject = open_environment("tests.conformance.environments:by_hash")
    rules = [rule for rule in RULES if rule.area in ("contract", "starts", "repeats")]
    outcomes = {outcome.rule.id: outcome for outcome in Examination(lambda: subject, rules).outcomes()}
    subject.abandon()
    assert outcomes["env/repeats/process"].broken, outcomes["env/repeats/process"]
    (finding,) = outcomes["env/repeats/process"].broken
    assert all(part in finding.observed for part in ("0 steps", "position"))
    assert outcomes["env/repeats/same"].state == "kept"


def test_a_factory_that_declares_nothing_is_called_with_its_arguments() -> None:
    declared = FactoryName.read("tests.conformance.environments:plain:task_id=3").load()
    environment = declared.make()
    assert environment.task_id == 3
    environment.close()
    assert declared.reference == DEFAULT_REFERENCE


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("tests.conformance.environments:plane", "Did you mean 'plain'"),
        ("tests.conformance.no_such:plain", "cannot be imported"),
    ],
)
def test_what_cannot_be_loaded_says_what_is_missing(name: str, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        FactoryName.read(name).load()


@pytest.mark.parametrize("name", references())
def test_references_that_ship_are_whole(name: str) -> None:
    reference = read_reference(name)
    assert len(reference.actions) == len(reference.steps) == reference.success_step
    assert len(reference.moves) == 6
    assert len(reference.openings) == 3
    assert {reference.picture(camera).shape for camera in CAMERAS} == {(SIDE, SIDE, 3)}
    assert {"mujoco", "robosuite"} <= {*reference.versions}


def test_a_reference_that_is_not_there_is_named() -> None:
    with pytest.raises(OptionError, match="Did you mean"):
        read_reference("libero_spatial-1")
