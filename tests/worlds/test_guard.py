from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
import pytest

from pytest_libero_max.substrates.tiny.world import TinySubstrate, TinyWorld
from pytest_libero_max.worlds import guard
from pytest_libero_max.worlds.guard import ModelGuard
from pytest_libero_max.worlds.mujoco_scenery import ALTERABLE
from tests.worlds.states import differing, every_array


def leaves(owner: Any, path: str) -> Iterator[tuple[str, Any, str]]:
    """Written on its own: every number and array below a struct of a model."""
    for name in dir(owner):
        value = getattr(owner, name)
        if name.startswith("_") or callable(value):
            continue
        if isinstance(value, np.ndarray) and value.size == 0:
            continue
        if isinstance(value, np.ndarray | int | float):
            yield f"{path}.{name}", owner, name
        else:
            yield from leaves(value, f"{path}.{name}")


def test_every_array_of_a_model_is_guarded_or_alterable() -> None:
    world = TinyWorld()
    world.reset(0)
    model = world.model
    for name, before in every_array(model).items():
        array = getattr(model, name)
        if name in ALTERABLE or array.size == 0:
            continue
        array.reshape(-1).view(np.uint8)[0] ^= 1
        assert world.take_back_writes() == (name,)
        assert array.tobytes() == before.tobytes(), name
    assert world.take_back_writes() == ()
    assert not world.spoiled


def test_every_option_is_guarded() -> None:
    world = TinyWorld()
    model = world.model
    every = [leaf for struct in ("opt", "stat", "vis") for leaf in leaves(getattr(model, struct), struct)]
    found = [leaf for leaf in every if leaf[0] not in guard.RENDERERS]
    assert len(found) == len(every) - len(guard.RENDERERS) > 100
    for path, owner, name in found:
        value = getattr(owner, name)
        former = value.copy() if isinstance(value, np.ndarray) else value
        if isinstance(value, np.ndarray):
            value.reshape(-1)[0] += 1.0
        else:
            setattr(owner, name, value + 1)
        assert world.take_back_writes() == (path,)
        assert np.array_equal(getattr(owner, name), former), path
    assert world.take_back_writes() == ()


def test_what_changes_alter_is_not_guarded() -> None:
    world = TinyWorld()
    world.reset(0)
    world.alter("light_diffuse", slice(None), 0.1)
    world.park("milk_1" if "milk_1" in world.entities else next(iter(world.entities)), (0.0, 0.0, -5.0))
    for _ in range(5):
        world.step([0.2] * 7)
    assert world.take_back_writes() == ()


@pytest.mark.parametrize(
    "write",
    [
        pytest.param(lambda words: words.__setitem__(slice(0, 2), words[[1, 0]]), id="two words swapped"),
        pytest.param(lambda words: words.__setitem__(-1, words[-1] + 1), id="the last word"),
        pytest.param(lambda words: words.__setitem__([5, 1029], words[[1029, 5]]), id="two rows apart"),
    ],
)
def test_a_write_to_a_large_field_is_found_and_spoils_the_scene(
    monkeypatch: pytest.MonkeyPatch, write: Callable[[np.ndarray], None]
) -> None:
    monkeypatch.setattr(guard, "COPIED_BYTES", 1000)
    picture = '<texture name="a" type="2d" builtin="checker" width="128" height="64"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset>{picture}</asset><worldbody><geom size="1"/></worldbody></mujoco>'
    )
    model.tex_data[:] = np.random.default_rng(1).integers(0, 256, model.tex_data.size)
    watched = ModelGuard(model, ())
    assert watched.take_back() == ()
    write(model.tex_data[: model.tex_data.size // 8 * 8].view(np.uint64))
    assert watched.take_back() == ("tex_data",)
    assert watched.spoiled
    assert watched.take_back() == ()  # said once


def test_a_spoiled_scene_is_built_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "COPIED_BYTES", 0)
    substrate = TinySubstrate()
    world = substrate.world(None)  # type: ignore[arg-type]  # the tiny one plays every case
    fresh = every_array(world.model)
    world.model.geom_friction[0] = 0.0
    assert world.take_back_writes() == ("geom_friction",)
    assert world.spoiled
    again = substrate.world(None)  # type: ignore[arg-type]
    assert again is not world
    assert differing(fresh, every_array(again.model)) == []
    substrate.close()


def test_the_entities_of_a_world_cannot_be_written() -> None:
    world = TinyWorld()
    with pytest.raises(TypeError):
        world.entities["box_1"] = world.entities["plate_1"]  # type: ignore[index]


def test_drawing_is_no_write() -> None:
    world = TinyWorld()
    world.reset(0)
    for size in (64, 300):  # the second one needs larger buffers
        world.observe(("agentview",), size)
        world.alter("light_castshadow", slice(None), 1 - world.model.light_castshadow)
        world.observe(("agentview",), size)
    assert world.take_back_writes() == ()
    world.close()


def test_what_the_renderer_sets_cannot_alter_a_picture() -> None:
    world = TinyWorld()
    world.reset(0)
    before = world.observe(("agentview",), 64)["agentview_image"]
    vis = world.model.vis
    vis.global_.offwidth = vis.global_.offheight = 32
    vis.quality.offsamples, vis.quality.shadowsize, vis.map.shadowclip = 0, 16, 0.01
    assert np.array_equal(world.observe(("agentview",), 64)["agentview_image"], before)
    world.close()
