"""Policies with one mistake each: its rule finds it, and no other ``must``; sound ones keep every rule."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.conformance.lines import CheckLine, check_lines
from pytest_libero_max.conformance.policy import contract, determinism
from pytest_libero_max.conformance.policy.subject import PolicySubject, Shown, observe
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination, Outcome
from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.clients.transport import LOG as SERVER_LOG
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.policies.model_inputs import INPUTS, as_image, picture_sheet
from pytest_libero_max.policies.transforms.images import resize_area
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.robot import Robot
from tests.conformance import policies as gallery
from tests.conformance.policies import SPEC, Sound
from tests.worlds.numpy_world import NumpyWorld

RULES = rules_for("policy")

GALLERY: list[tuple[type[Sound], str, str]] = [
    (gallery.Flipped, "images/rotated", r"is flipped upside down \(\[::-1\]\)"),
    (gallery.Mirrored, "images/rotated", "is mirrored left to right"),
    (gallery.AsDelivered, "images/rotated", "is as delivered, bottom row first"),
    (gallery.Transposed, "images/rotated", "is transposed"),
    (gallery.FlippedPart, "images/rotated", "is flipped upside down"),
    (gallery.Bgr, "images/colours", "has blue and red exchanged"),
    (gallery.Exchanged, "images/cameras", "is the image of agentview"),
    (gallery.Antipodal, "state/form", "antipodal rule"),
    (gallery.WFirst, "state/order", "read in the wrong order"),
    (gallery.Writing, "contract/observation", "robot0_eef_quat was written to"),
    (gallery.Broken, "contract/answers", "KeyError"),
    (gallery.NotFinite, "contract/answers", "must be finite"),
    (gallery.Redeclaring, "contract/spec", "query_interval of the spec changed"),
    (gallery.Stale, "inputs/any", "stays the same whatever is shown"),
    (gallery.Blind, "inputs/images", "does not depend on agentview_image, robot0_eye_in_hand_image"),
    (gallery.Deaf, "inputs/instruction", "does not depend on the instruction"),
    (gallery.Stateless, "inputs/state", "does not depend on the state"),
    (gallery.OwnGenerator, "determinism/query", "two different answers"),
    (gallery.Reversed, "determinism/company", "other answers than predict"),
    (gallery.InCompany, "determinism/rounding", "by up to 4e-07 with the size of the batch alone"),
    (gallery.Disturbed, "determinism/rounding", "by up to 3e-07 with the other queries"),
    (gallery.LearningTasks, "memory/reset", "depends on the episodes before"),
    (gallery.Remembering, "memory/declared", "depends on the queries before it"),
    (gallery.Aliased, "memory/snapshot", "after restore"),
    (gallery.Drifting, "chunk/length", "5, 6, 7, 8 actions"),
    (gallery.ShortChunk, "chunk/horizon", "returns 6 actions"),
    (gallery.Suffix, "chunk/first", "the last actions of the chunk"),
    (gallery.Refusing, "chunk/cut", "--libero-max-horizon=4 is not followed"),
    (gallery.Unnormalised, "actions/units", r"movement up to 3\d"),
    (gallery.Degrees, "actions/units", r"rotation up to 4"),
    (gallery.MovingAsPosing, "actions/units", "m from the hand"),
    (gallery.PosingAsMoving, "actions/units", "rotation up to"),
    (gallery.Still, "actions/moves", "no movement at all"),
    (gallery.Small, "actions/large", r"movement up to 0\.0[34]"),
    (gallery.SmallRotation, "actions/rotation", "rotation up to 0.007"),
    (gallery.Clipped, "actions/clipped", "beyond 1 and will be clipped"),
    (gallery.WideGripper, "gripper/units", "-255"),
    (gallery.Flag, "gripper/units", "0 or 1"),
    (gallery.Opening, "gripper/units", "from 0.6 to 0.95"),
    (gallery.ClosingFirst, "gripper/opens", "closes at once"),
]
MAY_ALSO_BREAK = {
    # One that draws from a generator of its own gives another answer to whatever it is asked again.
    gallery.OwnGenerator: r"policy/(determinism|memory)/.*",
    gallery.Refusing: "",
}


@pytest.fixture(scope="module")
def shown() -> Iterator[Shown]:
    world = TinyWorld()
    yield observe(Sound(), world)
    world.close()


def examine(policy: Any, shown: Shown) -> dict[str, Outcome]:
    outcomes = Examination(lambda: PolicySubject(policy, shown), RULES).outcomes()
    return {outcome.rule.id.removeprefix("policy/"): outcome for outcome in outcomes}


_EXAMINED: dict[type[Sound], dict[str, Outcome]] = {}


def examined(policy: type[Sound], shown: Shown) -> dict[str, Outcome]:
    """Return the outcomes of a policy of the gallery, which is examined once."""
    if policy not in _EXAMINED:
        _EXAMINED[policy] = examine(policy(), shown)
    return _EXAMINED[policy]


def broken(outcomes: dict[str, Outcome]) -> list[str]:
    return [name for name, outcome in outcomes.items() if outcome.state == "broken"]


def lines(policy: type[Sound], shown: Shown, *, strict: bool = False) -> list[CheckLine]:
    return check_lines([*examined(policy, shown).values()], strict=strict)


@pytest.mark.parametrize("policy", [Sound, gallery.Copied, gallery.Posing, gallery.Undisturbed])
def test_a_sound_policy_keeps_every_rule(policy: type[Sound], shown: Shown) -> None:
    outcomes = examined(policy, shown)
    unexamined = {name for name, outcome in outcomes.items() if outcome.state == "unexamined"}
    assert not broken(outcomes)
    # An object of this process is not loaded in another one; poses are no movements.
    assert unexamined - {"actions/large", "actions/clipped", "actions/rotation"} == {"determinism/process"}


@pytest.mark.filterwarnings("ignore:divide by zero")
@pytest.mark.parametrize(
    ("policy", "name", "observed"), GALLERY, ids=[entry[0].__name__ for entry in GALLERY]
)
def test_a_mistake_breaks_its_rule_and_no_other_must(
    policy: type[Sound], name: str, observed: str, shown: Shown
) -> None:
    outcomes = examined(policy, shown)
    found = [finding for finding in outcomes[name].broken if re.search(observed, finding.observed)]
    assert found, f"{broken(outcomes)}: {[finding.observed for finding in outcomes[name].findings]}"
    assert all(finding.expected and finding.cure for finding in found)
    others = {each.rule.id for each in outcomes.values() if each.fails} - {f"policy/{name}"}
    assert not [id for id in others if not re.fullmatch(MAY_ALSO_BREAK.get(policy, "none"), id)]


def test_every_rule_has_a_policy_that_breaks_it() -> None:
    elsewhere = {"contract/loads", "determinism/process", "determinism/declared", "time/first", "time/later"}
    assert {rule.id.removeprefix("policy/") for rule in RULES} == {entry[1] for entry in GALLERY} | elsewhere


def test_a_policy_that_cannot_be_loaded_breaks_the_first_rule_alone() -> None:
    def fail() -> PolicySubject:
        raise AdapterError("no such file")

    outcomes = Examination(fail, RULES).outcomes()
    assert [outcome.rule.id for outcome in outcomes if outcome.state == "broken"] == [contract.LOADS]
    assert {outcome.findings[0].observed for outcome in outcomes[1:]} == {f"{contract.LOADS} is broken"}


@pytest.mark.parametrize(("limit", "name"), [("SLOW_FIRST_S", "time/first"), ("SLOW_PAIR_S", "time/later")])
def test_slow_queries_are_noted(limit: str, name: str, shown: Shown, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contract, limit, 0.0)
    assert broken(examine(Sound(), shown)) == [name]


@pytest.mark.filterwarnings("ignore:divide by zero")
@pytest.mark.parametrize(
    "policy", [policy for policy, name, _ in GALLERY if name not in ("inputs/state", "determinism/rounding")]
)
def test_strictly_every_broken_adapter_is_wrong(policy: type[Sound], shown: Shown) -> None:
    harmless = policy in (gallery.SmallRotation, gallery.Refusing)
    assert ("wrong" in {line.word for line in lines(policy, shown, strict=True)}) is not harmless


def test_a_part_of_an_image_a_stack_of_frames_and_columns_of_a_rotation_are_recognised(shown: Shown) -> None:
    outcomes = examine(gallery.Parts(), shown)
    assert not broken(outcomes)
    texts = {finding.part: finding.observed for finding in outcomes["images/rotated"].findings}
    assert re.fullmatch("agentview, .*180 .*part.*", texts["input 'image'"])
    assert "input 'wrist_image[1]'" in texts
    assert "two columns" in outcomes["state/form"].findings[0].observed


def test_what_cannot_be_compared_is_named(shown: Shown) -> None:
    skipped = [line.text for line in lines(gallery.Unrecognisable, shown) if line.word == "skip"]
    expected = (
        "object of this process",
        "input 'heat'",
        "no image of agentview",
        "robot0_eye_in_hand",
        "orientation",
    )
    assert len(skipped) == len(expected)
    assert all(part in text for part, text in zip(expected, skipped, strict=True)), skipped


AGENTS = Path(__file__).parents[2] / "AGENTS.md"


@pytest.mark.filterwarnings("ignore:divide by zero")
def test_the_page_for_coding_assistants_explains_what_is_said_of_each_broken_adapter(shown: Shown) -> None:
    table = AGENTS.read_text().partition("| `check` says |")[2].partition("\n\n")[0]
    rows = table.splitlines()[2:]
    phrases = [phrase for row in rows for phrase in re.findall("`([^`]+)`", row.split("|")[1])]
    said = {
        policy.__name__: [str(line) for line in lines(policy, shown) if line.word in ("wrong", "note")]
        for policy, *_ in GALLERY
    }
    for phrase in phrases:
        assert any(phrase in line for texts in said.values() for line in texts), phrase
    harmless = [name for name, texts in said.items() if not any(text.startswith("wrong") for text in texts)]
    assert f"Of the {len(said)} broken adapters" in AGENTS.read_text()
    assert f"{len(harmless)} get a `note`" in AGENTS.read_text()


def test_a_policy_without_seeds_is_not_blamed_for_what_it_declares(shown: Shown) -> None:
    policy = gallery.OwnGenerator()
    policy.spec = PolicySpec("server", 8, 4, image_size=32, repeatable=False)
    outcomes = examine(policy, shown)
    assert broken(outcomes) == ["determinism/declared"]
    assert "repeatable=False says so" in outcomes["determinism/declared"].broken[0].observed
    assert outcomes["memory/reset"].state == "unexamined"
    seeded = Sound()
    seeded.spec = replace(SPEC, repeatable=False)
    (finding,) = examine(seeded, shown)["determinism/declared"].broken
    assert "repeated itself" in finding.observed


def test_a_server_that_refuses_another_h_is_a_finding_and_no_warning(
    shown: Shown, caplog: pytest.LogCaptureFixture
) -> None:
    assert broken(examine(gallery.Refusing(), shown)) == ["chunk/cut"]
    assert not caplog.records
    SERVER_LOG.warning("heard again")
    assert len(caplog.records) == 1


def test_a_policy_that_tells_nothing_is_asked_to(shown: Shown) -> None:
    class Silent(Sound):
        model_inputs = None  # type: ignore[assignment]

        def chunk(self, observation: Observation, query: Query) -> Any:
            return Sound().chunk(observation, query)

    _, silent = (line.text for line in lines(Silent, shown) if line.word == "skip")
    assert all(part in silent for part in INPUTS)


def test_a_privileged_policy_is_shown_the_world_in_the_state_of_its_query() -> None:
    class Reading(Sound):
        def reset(self, episode: Episode) -> None:
            self.world = episode.world

        def chunk(self, observation: Observation, query: Query) -> Any:
            assert self.world is not None
            assert np.array_equal(self.world.end_effector(), observation["robot0_eef_pos"])
            return super().chunk(observation, query)

    policy, world = Reading(), TinyWorld()
    policy.spec = replace(SPEC, privileged=True)
    outcomes = examine(policy, observe(policy, world))
    world.close()
    assert not broken(outcomes)
    assert "(privileged)" in outcomes["inputs/any"].findings[0].observed


@pytest.mark.parametrize(("grip", "state"), [(1.0, "kept"), (-1.0, "broken")])
def test_a_policy_of_another_robot_is_judged_by_its_components_and_signs(grip: float, state: str) -> None:
    class Sliding:
        """Moves a hand of four components whose gripper opens with +1."""

        spec = PolicySpec("sliding", 2, 2, cameras=(), robot=None)

        def reset(self, episode: Episode) -> None:
            assert episode.robot.components == 4

        def predict(self, observation: Observation, query: Query) -> Any:
            return np.tile([*(0.5 - observation["robot0_joint_pos"]).clip(-1, 1), grip], (2, 1))

    state_keys = {"robot0_joint_pos": 3, "robot0_gripper_qpos": 1}
    robot = Robot(name="slider", noop=(0.0, 0.0, 0.0, 1.0), state=state_keys)
    outcomes = examine(Sliding(), observe(Sliding(), NumpyWorld(robot)))
    assert outcomes["gripper/opens"].state == state
    assert {*broken(outcomes)} <= {"gripper/opens", "inputs/instruction"}  # it reads no instruction


@pytest.mark.parametrize(
    ("answers", "state"),
    [(lambda here: here, "kept"), (lambda here: [[[0.0] * 7]] * 4, "broken")],
    ids=["the same", "others"],
)
def test_answers_of_a_fresh_process_are_compared(
    answers: Any, state: str, shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    subject = PolicySubject(Sound(), shown, {"reference": "adapter.py"})
    here = [answer.tolist() for answer in subject.first.answers]
    monkeypatch.setattr(determinism, "_answers_elsewhere", lambda subject: answers(here))
    assert Examination(lambda: subject, RULES).outcome("policy/determinism/process").state == state


def test_images_are_found_in_every_usual_form() -> None:
    image = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    forms: list[Any] = [
        image,
        image[None, None],
        np.moveaxis(image, 2, 0),
        image.astype(np.float32) / 255,
        np.moveaxis(image.astype(np.float32) / 127.5 - 1, 2, 0)[None],
    ]
    for form in forms:
        found = as_image(form)
        assert found is not None
        assert np.abs(found.astype(int) - image).max() <= 1
    others: list[Any] = [np.zeros(8), np.zeros((10, 7)), np.zeros((16, 16, 3), dtype=bool)]
    for other in others:
        assert as_image(other) is None


def test_the_sheet_has_every_image_at_the_same_height() -> None:
    image = np.full((32, 32, 3), 200, dtype=np.uint8)
    sheet = picture_sheet({"image": image, "both": np.concatenate([image, image], 1), "state": np.zeros(8)})
    assert sheet.shape == (276, 256 + 512, 3)
    assert resize_area(sheet[100:116, 300:316], 2).tolist() == np.full((2, 2, 3), 200).tolist()
