"""Every variation leaves alone what it does not declare, and is undone by the next reset."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pytest_libero_max.changes import change_from_dict
from pytest_libero_max.substrates.embedded.catalogue.plus_catalogue import plus_suite
from pytest_libero_max.substrates.embedded.catalogue.pro_catalogue import pro_suite, pro_variations
from pytest_libero_max.substrates.embedded.remodel import Remodel
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.tasks.sources import PRO_CATEGORIES
from pytest_libero_max.worlds.contract import OnMujoco
from pytest_libero_max.worlds.robot import NOOP_ACTION
from tests.changes.world_comparison import differing, full_state, play, pose_bytes

LIGHTS = ("light_ambient", "light_castshadow", "light_diffuse", "light_dir", "light_pos", "light_specular")
KINDS = (
    ("plus", "Background Textures", "table"),
    ("plus", "Background Textures", "table_and_wall"),
    ("plus", "Camera Viewpoints", "distance"),
    ("plus", "Camera Viewpoints", "orientation"),
    ("plus", "Camera Viewpoints", "spherical"),
    ("plus", "Language Instructions", "language"),
    ("plus", "Light Conditions", "light"),
    ("plus", "Objects Layout", "add"),
    ("plus", "Objects Layout", "level"),
    ("plus", "Robot Initial States", "robot"),
    ("plus", "Sensor Noise", "noise"),
    ("pro", "camera_view_angle", "placed"),
    ("pro", "initial_pose_position_angle", "elsewhere"),
    ("pro", "object", "recast"),
    ("pro", "object_shape", "resized"),
    ("pro", "object_texture", "covered"),
    ("pro", "position", "exchange"),
    ("pro", "semantic", "paraphrase"),
    ("pro", "task", "other task"),
    ("pro", "view_occlusion", "occluder"),
    ("pro", "visual_noise_glare", "dark, glare, noise"),
)
"""All of them; the catalogue itself takes seconds, for which collection should not wait."""


TASKS = (("libero_spatial", 0), ("libero_object", 3), ("libero_goal", 8))
"""Tasks whose variations are tried, so that few scenes are built."""


@cache
def per_kind() -> dict[tuple[str, str, str], list[Variation]]:
    kinds: dict[tuple[str, str, str], list[Variation]] = {}
    for suite, index in TASKS:
        pro = (pro_suite(category, suite)[index] for category in PRO_CATEGORIES)
        for variation in (*(each for each in plus_suite(suite) if each.base_index == index), *pro):
            kinds.setdefault((variation.source, variation.category, variation.kind), []).append(variation)
    return kinds


def test_every_kind_is_tried() -> None:
    assert {*KINDS} == {*per_kind()}


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate(scenes=6)
    yield substrate
    substrate.close()


def bare(variation: Variation) -> Variation:
    """The same task without any variation."""
    return replace(variation, scene={}, changes=())


def materials(world: OnMujoco) -> dict[str, tuple[bytes, str]]:
    """What each material looks like, by name."""
    model = world.model
    looks = {}
    for number in range(model.nmat):
        texture = int(model.mat_texid[number][1])
        picture = "" if texture < 0 else model.tex(texture).name
        looks[model.mat(number).name] = (model.mat_rgba[number].tobytes(), picture)
    return looks


def arm(world: OnMujoco) -> bytes:
    return world.observe(cameras=())["robot0_joint_pos"].tobytes()


def cameras(world: OnMujoco) -> dict[str, list[bytes]]:
    model = world.model
    fields = (model.cam_pos, model.cam_quat, model.cam_fovy)
    return {model.camera(n).name: [field[n].tobytes() for field in fields] for n in range(model.ncam)}


def lights(world: OnMujoco) -> list[bytes]:
    return [getattr(world.model, field).tobytes() for field in LIGHTS]


@pytest.mark.parametrize("kind", KINDS, ids="-".join)
@settings(max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_what_a_variation_does_not_declare_is_bit_identical(
    substrate: EmbeddedSubstrate, kind: tuple[str, str, str], data: st.DataObject
) -> None:
    variation = data.draw(st.sampled_from(per_kind()[kind]), label="variation")
    init = 0 if variation.source == "plus" else data.draw(st.integers(0, 9), label="init")
    factors = set().union(*(change_from_dict(raw).factors for raw in variation.changes))
    plan = Remodel.from_dict(variation.scene)
    base = substrate.varied_world(bare(variation))
    base.reset(init)
    poses = {name: pose_bytes(base, name) for name in base.entities}
    seen = arm(base), cameras(base), lights(base), materials(base), base.language, base.goal, base.filters
    world = substrate.varied_world(variation)
    world.reset(init)
    renamed = {plan.renamed(name) for name in poses}
    assert set(world.entities) == renamed | {name for name, _ in plan.extras}
    assert world.parked == ()
    for name, pose in poses.items():
        if f"pose:{plan.renamed(name)}" not in factors:
            assert pose_bytes(world, plan.renamed(name)) == pose, name
    if "robot" not in factors:
        assert arm(world) == seen[0]
    moved = {name for name, look in cameras(world).items() if look != seen[1][name]}
    assert {f"camera:{name}" for name in moved} <= factors
    assert (lights(world) != seen[2]) == ("light" in factors)
    recast = {kind for *_, kind in plan.recast}
    for name, look in materials(world).items():
        if name in seen[3] and "material" not in factors and not any(name.startswith(k) for k in recast):
            assert look == seen[3][name]
    assert (world.language != seen[4]) == ("instruction" in factors)
    if "goal" not in factors:
        assert [plan.renamed(fact.subject) for fact in seen[5]] == [fact.subject for fact in world.goal]
    else:
        assert world.goal != seen[5]
    assert (world.filters != ()) == ("pixels" in factors)
    assert not world.succeeded()


@pytest.mark.parametrize("kind", KINDS, ids="-".join)
@settings(max_examples=2, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_reset_undoes_a_variation_and_makes_it_again(
    substrate: EmbeddedSubstrate, kind: tuple[str, str, str], data: st.DataObject
) -> None:
    variation = data.draw(st.sampled_from(per_kind()[kind]), label="variation")
    world = substrate.varied_world(variation)
    plain = world.varied(None)
    plain.reset(0)
    fresh = full_state(plain)
    world.reset(0)
    varied = full_state(world)
    # What is recast in another colour alone is in the compiled scene, and nothing is left to do at reset.
    assert bool(differing(fresh, varied) or world.assigned != (None, None)) == bool(variation.changes)
    play(world, [NOOP_ACTION] * 2)
    plain.reset(0)
    assert differing(fresh, full_state(plain)) == set()
    assert plain.language != world.language or world.assigned[0] is None
    world.reset(0)
    assert differing(varied, full_state(world)) == set()


def test_worlds_are_built_again_after_they_had_to_make_room() -> None:
    substrate = EmbeddedSubstrate(scenes=2)
    variations = pro_suite("object_shape", "libero_spatial")[:3]
    try:
        digests = []
        for variation in (*variations, *variations):
            world = substrate.varied_world(variation)
            world.reset(3)
            digests.append(world.digest())
        assert digests[:3] == digests[3:]
        assert len(set(digests)) == 3
        assert len(substrate._worlds) == 2
    finally:
        substrate.close()


def test_worlds_of_one_scene_keep_their_variations_apart(substrate: EmbeddedSubstrate) -> None:
    first, second = per_kind()["plus", "Language Instructions", "language"][:2]
    one, other = substrate.varied_world(first), substrate.varied_world(second)
    one.reset(0)
    words = one.language
    other.reset(0)
    assert one.model is other.model
    assert other.language == second.changes[0]["instruction"] != words == first.changes[0]["instruction"]


def test_things_stay_where_a_variation_puts_them(substrate: EmbeddedSubstrate) -> None:
    for variation in [v for v in pro_variations() if v.category in ("position", "view_occlusion")][::20]:
        world = substrate.varied_world(variation)
        world.reset(0)
        names = [name for name, entity in world.entities.items() if entity.kind == "object"]
        before = {name: world.position(name) for name in names}
        play(world, [NOOP_ACTION] * 20)
        for name in names:
            assert np.linalg.norm(world.position(name) - before[name]) < 0.006, (variation.key, name)


@pytest.mark.parametrize("kind", KINDS, ids="-".join)
def test_a_variation_is_taken_back_change_by_change(
    substrate: EmbeddedSubstrate, kind: tuple[str, str, str]
) -> None:
    """All but velocities (what was moved is at rest), the order of what is out of the scene, and the goal of
    the arm's controller."""

    def seen() -> dict[str, Any]:
        state = full_state(world)
        poses = {name: pose_bytes(world, name) for name in world.entities}
        parked = sorted(state.pop("parked"))
        return {**state, "parked": parked, "poses": poses, "assigned": world.assigned}

    variation = per_kind()[kind][len(per_kind()[kind]) // 2]
    world = substrate.varied_world(variation).varied(None)
    world.reset(0)
    changes = [change_from_dict(raw) for raw in variation.changes]
    states, evidence = [], []
    for change in changes:
        states.append(seen())
        evidence.append(change.apply(world))
        assert differing(states[-1], seen())
    for change, found, state in zip(reversed(changes), reversed(evidence), reversed(states), strict=True):
        change.reverted(found).apply(world)
        free = {"qvel", "physics", *(["controller"] if change.operation == "offset_arm" else [])}
        assert differing(state, seen()) <= free
