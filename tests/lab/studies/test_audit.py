"""The arms of an audit, played on the tiny world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.events.schedules import Arm
from pytest_libero_max.lab.studies.audit import Audit
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.policies.contract import Query
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.tasks.libero_tasks import tasks
from pytest_libero_max.worlds.contract import Observation
from tests.pairing.actors import BUDGET, Approaching, make_case


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


class Noting(Approaching):
    """Keeps all that it was shown."""

    def __init__(self) -> None:
        super().__init__(0, 25, 25, ("agentview", "robot0_eye_in_hand"))
        self.shown: list[tuple[str, dict[str, Any]]] = []

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        self.shown.append((query.instruction, dict(observation)))
        return super().predict(observation, query)


def test_an_audit_changes_one_input_and_nothing_else(world: TinyWorld) -> None:
    case = make_case(record={"case_id": "case", "task_name": tasks("libero_spatial")[3].name + "_light_2"})
    policy = Noting()
    arms = {arm.name: arm for arm in Audit().arms(case, policy.spec)}
    assert list(arms) == [
        "black_images",
        "still_images",
        "other_images",
        "no_agentview",
        "no_robot0_eye_in_hand",
        "no_state",
        "no_instruction",
        "other_instruction",
        "paraphrase",
    ]
    shown = {}
    for name, arm in {"base": Arm("base"), **arms}.items():
        policy.shown.clear()
        record = measure_pair(case, world, policy, arms=(arm,)).record.arms[name]
        shown[name] = list(policy.shown)
        assert record.steps == BUDGET or record.success
    own = tasks("libero_spatial")[3].language
    for name, seen in shown.items():
        assert len(seen) == len(shown["base"])  # it does not look, so it acts as in Base
        for (words, now), (base_words, base) in zip(seen, shown["base"], strict=True):
            images = {key: value for key, value in now.items() if key.endswith("_image")}
            dark = {
                "black_images": set(images),
                "no_agentview": {"agentview_image"},
                "no_robot0_eye_in_hand": {"robot0_eye_in_hand_image"},
            }.get(name, set())
            for key, image in images.items():
                still = name in ("still_images", "other_images")  # the tiny world knows one task
                wanted = seen[0][1][key] if still else base[key] * (key not in dark)
                assert np.array_equal(image, wanted)
            for key in now.keys() - images.keys():
                rest = [0.0, 0.0, 0.0, 1.0] if key.endswith("_quat") else 0.0
                wanted = np.broadcast_to(rest, base[key].shape) if name == "no_state" else base[key]
                assert np.array_equal(now[key], wanted)
            if name == "no_instruction":
                assert words == ""
            elif name in ("other_instruction", "paraphrase"):
                assert words not in (base_words, own)
            else:
                assert words == base_words


def test_an_audit_leaves_out_what_a_case_or_a_policy_does_not_have() -> None:
    def names(policy: Approaching, **changes: Any) -> list[str]:
        return [arm.name for arm in Audit().arms(make_case(**changes), policy.spec)]

    record = {"case_id": "case", "task_name": tasks("libero_spatial")[0].name}
    words = ["no_state", "no_instruction", "other_instruction", "paraphrase"]
    assert names(Approaching(), record=record) == words
    one, images = Approaching(cameras=("agentview",)), ["black_images", "still_images", "other_images"]
    assert names(one, record=record) == [*images, *words]
    goal = {"case_id": "case", "task_name": tasks("libero_goal")[0].name}
    assert names(one, record=goal, suite="libero_goal") == [*images[:2], *words]  # one scene for all tasks
    assert names(one) == [*images[:2], *words[:2]]
    assert names(Approaching(), record=record, source_category="semantic") == words[:3]
    assert names(Approaching(), record=record, source_category="task") == words[:2]
    assert names(Approaching()) == words[:2]
