from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.scene_digest import (
    model_fields,
    state_fields,
    value_digest,
)

XML = '<mujoco><worldbody><body><geom name="{name}" size="{size}"/></body></worldbody></mujoco>'


@pytest.fixture
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def differing(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """The fields whose digests differ or that only one of the two has, sorted."""
    return sorted(name for name in {*one, *other} if one.get(name) != other.get(name))


def test_dtype_shape_and_content_of_an_array_count() -> None:
    array = np.arange(6.0)
    same = [array, array.copy(), np.arange(12.0)[::2] / 2]
    others = [array.astype(np.float32), array.reshape(2, 3), array.reshape(3, 2), array + 1e-15, -array]
    assert len({value_digest(value) for value in same}) == 1
    assert len({value_digest(value) for value in (array, *others)}) == 6


def test_one_byte_and_the_order_of_a_large_array_count() -> None:
    array = np.random.default_rng(0).integers(0, 255, 2**21, dtype=np.uint8)
    other, swapped = array.copy(), array.copy()
    other[12345] += 1
    swapped[[0, 2**20]] = swapped[[2**20, 0]]
    assert len({value_digest(value) for value in (array, other, swapped)}) == 3
    assert value_digest(array) == value_digest(array.copy())


def test_values_count_and_not_how_they_are_held() -> None:
    assert value_digest((1, (2.5, "a"))) == value_digest([1, [2.5, "a"]])
    assert value_digest([1]) != value_digest(["1"]) != value_digest(b"1")


def test_every_field_of_a_model_has_a_digest_by_its_name() -> None:
    models = [
        mujoco.MjModel.from_xml_string(XML.format(name=name, size=size))
        for name, size in (("ball", 0.1), ("ball", 0.1), ("bowl", 0.1), ("ball", 0.2))
    ]
    first, same, renamed, larger = (model_fields(model, {}) for model in models)
    assert {
        "model.geom_friction",
        "model.nq",
        "model.opt.gravity",
        "model.stat.extent",
        "model.names",
    } <= set(first)
    assert differing(first, same) == []
    assert differing(first, renamed) == ["model.names", "model.names_map"]
    assert {"model.geom_size", "model.body_mass"} <= set(differing(first, larger))
    models[1].opt.timestep = 0.001
    models[1].geom_friction[0, 0] = 0.5
    assert differing(first, model_fields(models[1], {})) == ["model.geom_friction", "model.opt.timestep"]


def test_what_a_change_alters_belongs_to_the_state_and_not_to_the_scene(world: TinyWorld) -> None:
    scene, state = dict(world.scene_fields()), state_fields(world.snapshot())
    other = TinyWorld()
    other.alter("light_diffuse", 0, 0.1)
    assert other.scene_fields() == scene
    assert differing(state, state_fields(other.snapshot())) == ["start.model.light_diffuse"]
    other.close()


def test_each_part_of_a_state_is_a_field(world: TinyWorld) -> None:
    state = world.snapshot()
    first = state_fields(state)
    moved = replace(state, physics=state.physics + 1.0, parked=(("plate_1", (0.0,)),), assigned=("go", None))
    assert differing(first, state_fields(moved)) == ["start.assigned", "start.parked", "start.physics"]
