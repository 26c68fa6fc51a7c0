"""The policies that ship with the package act as they did under their versions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pytest_libero_max.experts import random
from pytest_libero_max.policies.contract import Query
from pytest_libero_max.policies.references import parse_reference, shipped_names, shipped_version
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from tests.experts.golden_actions import WORLDS, actions_of, golden
from tests.mujoco_line import LINE


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


def require_golden(name: str, substrate: EmbeddedSubstrate) -> None:
    kept, actions = golden()[name], actions_of(name, substrate)
    version = shipped_version(parse_reference(name))
    different = "".join(
        f"\n  {scene}: {kept['actions'].get(scene)} under version {kept['version']}, {actions[scene]} now"
        for scene in actions
        if actions[scene] != kept["actions"].get(scene)
    )
    if different or kept["version"] != version:
        pytest.fail(
            f"policy {name!r} acts otherwise than under version {kept['version']}, or has another version:"
            f"{different}\nIf that is meant, raise VERSION in its module (it is {version}), and write the "
            "actions again: python -m tests.experts.golden_actions"
        )


@pytest.mark.parametrize("name", shipped_names())
def test_a_policy_acts_as_its_version_did(name: str, substrate: EmbeddedSubstrate) -> None:
    if name == "metaworld-expert":
        pytest.importorskip("metaworld", reason="metaworld is not installed")
    if name in WORLDS and LINE != "3.3":
        pytest.skip(f"{name} was not played with MuJoCo {LINE}")
    require_golden(name, substrate)


def test_a_policy_that_acts_otherwise_is_told_to_raise_its_version(
    substrate: EmbeddedSubstrate, monkeypatch: pytest.MonkeyPatch
) -> None:
    def quieter(self: random.RandomPolicy, observation: object, query: Query) -> np.ndarray:
        return np.random.default_rng(query.seed).uniform(-0.9, 0.9, (self.spec.horizon, 7))

    monkeypatch.setattr(random.RandomPolicy, "predict", quieter)
    with pytest.raises(pytest.fail.Exception, match=r"(?s)'random' .*raise VERSION") as error:
        require_golden("random", substrate)
    assert "the picture: 120 actions" in str(error.value)
