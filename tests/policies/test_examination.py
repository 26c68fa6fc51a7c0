"""A gallery of broken adapters: the examination must name the mistake of each, and none of sound ones."""

from __future__ import annotations

import copy
import re
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.transport import LOG as SERVER_LOG
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.policies.examination import examine, made_up
from pytest_libero_max.policies.finding import Finding, Shown
from pytest_libero_max.policies.model_inputs import INPUTS, as_image, picture_sheet
from pytest_libero_max.policies.transforms.images import resize_area, rotate_180
from pytest_libero_max.policies.transforms.states import axis_angle, axis_angle_antipodal, rotation_6d_columns
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Observation

SPEC = PolicySpec("sound", horizon=8, query_interval=4, image_size=32)


class Sound:
    """Answers from everything that it is shown; draws from the seed of the query."""

    def __init__(self) -> None:
        self.spec = SPEC

    def reset(self, episode: Episode) -> None:
        pass

    def image(self, image: Any) -> Any:
        return rotate_180(image)

    def rotation(self, quaternion: Any) -> Any:
        return axis_angle(quaternion)

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, Any]:
        return {
            "image": self.image(observation["agentview_image"]),
            "wrist_image": self.image(observation["robot0_eye_in_hand_image"]),
            "state": np.concatenate(
                [
                    observation["robot0_eef_pos"],
                    self.rotation(observation["robot0_eef_quat"]),
                    observation["robot0_gripper_qpos"],
                ]
            ),
        }

    def chunk(self, observation: Observation, query: Query) -> Any:
        told = self.model_inputs(observation, query)
        number = zlib.crc32(query.instruction.encode())
        for value in told.values():
            number = zlib.crc32(np.ascontiguousarray(value).tobytes(), number)
        actions = np.random.default_rng([number, query.seed]).uniform(-0.8, 0.8, (8, 7))
        actions[:, 6] = -1.0
        return actions

    def predict(self, observation: Observation, query: Query) -> Any:
        return self.chunk(observation, query)[: self.spec.horizon]


class Flipped(Sound):
    def image(self, image: Any) -> Any:
        return image[::-1]


class Mirrored(Sound):
    def image(self, image: Any) -> Any:
        return image[:, ::-1]


class AsDelivered(Sound):
    def image(self, image: Any) -> Any:
        return image


class Bgr(Sound):
    def image(self, image: Any) -> Any:
        return rotate_180(image)[:, :, ::-1]


class Exchanged(Sound):
    def model_inputs(self, observation: Observation, query: Query) -> dict[str, Any]:
        told = super().model_inputs(observation, query)
        return {**told, "image": told["wrist_image"], "wrist_image": told["image"]}


class Antipodal(Sound):
    def rotation(self, quaternion: Any) -> Any:
        return axis_angle_antipodal(quaternion)


class WFirst(Sound):
    def rotation(self, quaternion: Any) -> Any:
        return axis_angle(np.roll(quaternion, -1))


class Writing(Sound):
    def rotation(self, quaternion: Any) -> Any:
        quaternion[3] = abs(quaternion[3])
        quaternion[:3] *= 0.5
        return axis_angle(quaternion)


class Stale(Sound):
    def __init__(self) -> None:
        super().__init__()
        self.kept: Any = None

    def chunk(self, observation: Observation, query: Query) -> Any:
        if self.kept is None:
            self.kept = super().chunk(observation, query)
        return self.kept


class OwnGenerator(Sound):
    def __init__(self) -> None:
        super().__init__()
        self.generator = np.random.default_rng(0)

    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * [*self.generator.uniform(0.5, 1.0, 6), 1.0]


class Leaking(Sound):
    """Counts its queries over all episodes, and moves less at every seventh."""

    asked = 0

    def chunk(self, observation: Observation, query: Query) -> Any:
        self.asked += 1
        actions = super().chunk(observation, query)
        return actions * 0.5 if self.asked % 7 == 0 else actions


class Remembering(Sound):
    def reset(self, episode: Episode) -> None:
        self.last = np.zeros((8, 7))

    def chunk(self, observation: Observation, query: Query) -> Any:
        self.last = 0.5 * (self.last + super().chunk(observation, query))
        return self.last


class Copied(Remembering):
    """Sound: it remembers, and says so."""

    def snapshot(self) -> Any:
        return copy.deepcopy(self.last)

    def restore(self, memory: Any) -> None:
        self.last = copy.deepcopy(memory)


class Aliased(Copied):
    def chunk(self, observation: Observation, query: Query) -> Any:
        self.last[:] = 0.5 * (self.last + Sound.chunk(self, observation, query))
        return self.last.copy()

    def snapshot(self) -> Any:
        return self.last

    def restore(self, memory: Any) -> None:
        self.last = memory


class Drifting(Sound):
    def predict(self, observation: Observation, query: Query) -> Any:
        return self.chunk(observation, query)[: 8 - query.index]


class ShortChunk(Sound):
    def predict(self, observation: Observation, query: Query) -> Any:
        return self.chunk(observation, query)[:6][: self.spec.horizon]


class Suffix(Sound):
    def predict(self, observation: Observation, query: Query) -> Any:
        return self.chunk(observation, query)[-self.spec.horizon :]


class Unnormalised(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * ([40.0] * 6 + [1.0])


class Small(Sound):
    """Movements in metres; the gripper is right, and is the largest component."""

    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * ([0.05] * 6 + [1.0])


class SmallRotation(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * ([1.0] * 3 + [0.01] * 3 + [1.0])


class Degrees(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * ([1.0] * 3 + [57.3] * 3 + [1.0])


class Clipped(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * ([3.0] * 6 + [1.0])


class WideGripper(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * ([1.0] * 6 + [255.0])


class Transposed(Sound):
    def image(self, image: Any) -> Any:
        return image.transpose(1, 0, 2)


class FlippedPart(Sound):
    """Cuts the wall off, and flips what is left."""

    def image(self, image: Any) -> Any:
        return image[:22][::-1]


class Blind(Sound):
    """Tells the images, and answers from the state alone."""

    def chunk(self, observation: Observation, query: Query) -> Any:
        dark = {key: np.zeros_like(value) for key, value in observation.items() if key.endswith("_image")}
        return super().chunk({**observation, **dark}, query)


class ClosingFirst(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * ([1.0] * 6 + [-1.0])


class Flag(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        actions = super().chunk(observation, query)
        actions[:, 6] = 0.0
        return actions


class Opening(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        actions = super().chunk(observation, query)
        actions[:, 6] = np.linspace(0.6, 0.95, 8)
        return actions


class Deaf(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, Query(query.index, query.step, "", query.seed))


class Broken(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        raise KeyError("agentview")


class NotFinite(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) / [*[1.0] * 3, 0.0, *[1.0] * 3]


GALLERY: list[tuple[type[Sound], str, str, str]] = [
    (Flipped, "note", "input 'image'", r"is flipped upside down \(\[::-1\]\)"),
    (Mirrored, "note", "input 'image'", "is mirrored left to right"),
    (AsDelivered, "note", "input 'wrist_image'", "is as delivered, bottom row first"),
    (Bgr, "wrong", "input 'image'", "has blue and red exchanged"),
    (Exchanged, "wrong", "input 'wrist_image'", "is the image of agentview"),
    (Antipodal, "note", "input 'state'", "antipodal rule"),
    (WFirst, "wrong", "input 'state'", "read in the wrong order"),
    (Writing, "wrong", "observation", "robot0_eef_quat was written to"),
    (Stale, "wrong", "observation", "stays the same whatever is shown"),
    (OwnGenerator, "wrong", "seed", "two different answers"),
    (Leaking, "wrong", "reset|memory|seed", "depends on|two different"),
    (Remembering, "wrong", "memory", "depends on the queries before it"),
    (Aliased, "wrong", "snapshot", "after restore"),
    (Drifting, "note", "length", "5, 6, 7, 8 actions"),
    (ShortChunk, "note", "horizon", "returns 6 actions"),
    (Suffix, "wrong", "prefix", "the last actions of the chunk"),
    (Unnormalised, "wrong", "range", "movement up to 31.9"),
    (Small, "note", "range", "movement up to 0.0399, rotation"),
    (SmallRotation, "note", "range", "rotation up to 0.00799"),
    (Degrees, "wrong", "range", r"rotation up to 4"),
    (Clipped, "note", "range", "beyond 1 and will be clipped"),
    (WideGripper, "wrong", "gripper", "-255"),
    (Transposed, "note", "input 'image'", "is transposed"),
    (FlippedPart, "note", "input 'image'", "is flipped upside down"),
    (Blind, "note", "observation", "does not depend on agentview_image, robot0_eye_in_hand_image"),
    (ClosingFirst, "note", "gripper", "closes at once"),
    (Flag, "wrong", "gripper", "0 or 1"),
    (Opening, "wrong", "gripper", "from 0.6 to 0.95"),
    (Deaf, "note", "observation", "does not depend on the instruction"),
    (Broken, "wrong", "query", "KeyError"),
    (NotFinite, "wrong", "query", "must be finite"),
]


@pytest.fixture(scope="module")
def shown() -> Iterator[Shown]:
    world = TinyWorld()
    yield made_up(Sound(), world)
    world.close()


def bad(findings: list[Finding]) -> list[Finding]:
    return [finding for finding in findings if finding.level != "ok"]


@pytest.mark.parametrize("policy", [Sound, Copied])
def test_a_sound_adapter_is_clean(policy: type[Sound], shown: Shown) -> None:
    findings = examine(policy(), shown)
    assert not bad(findings), "\n".join(map(str, findings))
    assert {"latency", "horizon", "range", "gripper", "seed", "memory", "observation"} <= {
        finding.subject for finding in findings
    }


@pytest.mark.filterwarnings("ignore:divide by zero")
@pytest.mark.parametrize(
    ("policy", "level", "subject", "observed"), GALLERY, ids=[entry[0].__name__ for entry in GALLERY]
)
def test_a_broken_adapter_is_named(
    policy: type[Sound], level: str, subject: str, observed: str, shown: Shown
) -> None:
    findings = bad(examine(policy(), shown))
    named = [
        finding
        for finding in findings
        if finding.level == level
        and re.fullmatch(subject, finding.subject)
        and re.search(observed, finding.observed)
    ]
    assert named, "\n".join(map(str, findings))
    assert all(finding.mistake for finding in named), "what to do about it"


@pytest.mark.filterwarnings("ignore:divide by zero")
@pytest.mark.parametrize("policy", [entry[0] for entry in GALLERY if entry[0] is not SmallRotation])
def test_strictly_every_broken_adapter_is_wrong(policy: type[Sound], shown: Shown) -> None:
    assert "wrong" in {finding.strict().level for finding in examine(policy(), shown)}


def test_what_some_models_do_on_purpose_is_never_wrong(shown: Shown) -> None:
    assert {finding.strict().level for finding in examine(SmallRotation(), shown)} == {"ok", "note"}


class Parts(Sound):
    """Cuts every image, and stacks two frames of the wrist."""

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, Any]:
        told = super().model_inputs(observation, query)
        return {
            "image": told["image"][10:],
            "wrist_image": np.stack([told["wrist_image"][2:-2, 2:-2]] * 2),
            "state": np.concatenate(
                [observation["robot0_eef_pos"], rotation_6d_columns(observation["robot0_eef_quat"])]
            ),
        }


def test_a_part_of_an_image_a_stack_of_frames_and_columns_of_a_rotation_are_recognised(shown: Shown) -> None:
    findings = examine(Parts(), shown)
    assert not bad(findings), "\n".join(map(str, findings))
    texts = {finding.subject: finding.observed for finding in findings}
    assert texts["input 'image'"] == "agentview, rotated by 180 degrees, a part of it"
    assert "input 'wrist_image[1]'" in texts
    assert "two columns" in texts["input 'state'"]


class Unrecognisable(Sound):
    """Tells one camera as a heat map, nothing of the other, and a state of other numbers."""

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, Any]:
        told = super().model_inputs(observation, query)
        seed = zlib.crc32(told["image"].tobytes())
        heat = np.random.default_rng(seed).integers(0, 256, (32, 32, 3), np.uint8)
        return {"heat": heat, "numbers": 3.0 * told["state"]}


def test_what_cannot_be_compared_is_named(shown: Shown) -> None:
    skipped = [finding for finding in examine(Unrecognisable(), shown) if finding.level == "skip"]
    assert ["heat" in each.subject or each.subject == "inputs" for each in skipped] == [True] * 4
    text = " ".join(each.observed for each in skipped)
    assert all(
        part in text for part in ("no image of agentview", "robot0_eye_in_hand", "orientation of the hand")
    )


AGENTS = Path(__file__).parents[2] / "AGENTS.md"


def test_the_page_for_coding_assistants_explains_what_is_said_of_each_broken_adapter(shown: Shown) -> None:
    table = AGENTS.read_text().partition("| `check` says |")[2].partition("\n\n")[0]
    phrases = [
        phrase for row in table.splitlines()[2:] for phrase in re.findall("`([^`]+)`", row.split("|")[1])
    ]
    said = {
        policy.__name__: [str(finding) for finding in bad(examine(policy(), shown))] for policy, *_ in GALLERY
    }
    for name, lines in said.items():
        assert any(phrase in line for line in lines for phrase in phrases), f"{name}: {lines}"
    for phrase in phrases:
        assert any(phrase in line for lines in said.values() for line in lines), phrase
    harmless = [name for name, lines in said.items() if not any(line.startswith("wrong") for line in lines)]
    assert f"Of the {len(said)} broken adapters" in AGENTS.read_text()
    assert f"{len(harmless)} get a `note` and without `--strict` status 0" in AGENTS.read_text()


class InCompany(Sound):
    """Answers in batches; the last digits depend on the size of the batch."""

    def predict_batch(self, items: Any) -> Any:
        return [
            self.chunk(item.observation, item.query) + self.rounding(items, place)
            for place, item in enumerate(items)
        ]

    def rounding(self, items: Any, place: int) -> float:
        return 1e-7 * len(items)


class Undisturbed(InCompany):
    def rounding(self, items: Any, place: int) -> float:
        return 0.0


class Disturbed(InCompany):
    def rounding(self, items: Any, place: int) -> float:
        return 1e-7 * place


class Reversed(InCompany):
    def predict_batch(self, items: Any) -> Any:
        return super().predict_batch(items)[::-1]


@pytest.mark.parametrize(
    ("policy", "level", "observed", "mistake"),
    [
        (Undisturbed, "ok", "the same bytes", ""),
        (InCompany, "note", "by up to 4e-07 with the size of the batch alone", "--pad-batch"),
        (Disturbed, "note", "by up to 3e-07 with the other queries", "repeatable=False"),
        (Reversed, "wrong", "other answers than predict", "mixed up"),
    ],
)
def test_it_is_found_out_whether_answers_change_with_company(
    policy: type[Sound], level: str, observed: str, mistake: str, shown: Shown
) -> None:
    findings = [finding for finding in examine(policy(), shown) if finding.subject == "batch"]
    assert [finding.level for finding in findings] == [level]
    assert observed in findings[0].observed
    assert mistake in findings[0].mistake


def test_a_policy_without_seeds_is_not_blamed_for_what_it_declares(shown: Shown) -> None:
    policy = OwnGenerator()
    policy.spec = PolicySpec("server", 8, 4, image_size=32, repeatable=False)
    declared, unexamined = bad(examine(policy, shown))
    assert (declared.level, declared.probable) == ("note", False)
    assert "repeatable=False says so" in declared.observed
    assert (unexamined.level, unexamined.subject) == ("skip", "repeatable")


class Refusing(Sound):
    """Behind a server that retries what its adapter refuses, and warns of it."""

    def predict(self, observation: Observation, query: Query) -> Any:
        if self.spec.horizon < 8:
            SERVER_LOG.warning("the server reports an error; trying again")
            raise ServerError("it was given up")
        return self.chunk(observation, query)


def test_a_server_that_refuses_another_h_is_a_finding_and_no_warning(
    shown: Shown, caplog: pytest.LogCaptureFixture
) -> None:
    findings = bad(examine(Refusing(), shown))
    assert [finding.observed for finding in findings] == ["--libero-max-horizon=4 is not followed"]
    assert not caplog.records
    SERVER_LOG.warning("heard again")
    assert len(caplog.records) == 1


class Posing(Sound):
    """Under absolute control; stays near the hand."""

    def __init__(self) -> None:
        self.spec = replace(SPEC, control="absolute")

    def chunk(self, observation: Observation, query: Query) -> Any:
        actions = super().chunk(observation, query)
        actions[:, :3] = observation["robot0_eef_pos"] + 0.05 * actions[:, :3]
        actions[:, 3:6] *= 3.0
        return actions


class MovingAsPosing(Sound):
    def __init__(self) -> None:
        self.spec = replace(SPEC, control="absolute")


class PosingAsMoving(Posing):
    def __init__(self) -> None:
        self.spec = SPEC

    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) + np.array([0, 0, 0, 3.0, 0, 0, 0])


def test_poses_are_judged_by_where_the_hand_is(shown: Shown) -> None:
    assert not bad(examine(Posing(), shown))
    (moving,) = bad(examine(MovingAsPosing(), shown))
    assert (moving.level, moving.subject) == ("wrong", "range")
    assert "m from the hand" in moving.observed
    (posing,) = bad(examine(PosingAsMoving(), shown))
    assert 'declared with PolicySpec(control="absolute")' in posing.mistake


def test_a_policy_that_tells_nothing_is_asked_to(shown: Shown) -> None:
    class Silent(Sound):
        model_inputs = None  # type: ignore[assignment]

        def chunk(self, observation: Observation, query: Query) -> Any:
            actions = np.random.default_rng(
                [zlib.crc32(b"".join(np.asarray(v).tobytes() for v in observation.values())), query.seed]
            ).uniform(-0.8, 0.8, (8, 7))
            actions[:, 6] = -1.0
            return actions * (0.5 + 0.5 * (len(query.instruction) % 7) / 7)

    (silent,) = bad(examine(Silent(), shown))
    assert (silent.level, silent.subject) == ("skip", "inputs")
    assert all(part in silent.observed for part in INPUTS)


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
