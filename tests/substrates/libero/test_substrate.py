from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.changes import SwapImages
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.pairing.changing import begin_world
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.embedded.catalogue.lookup import catalogue, variation_of
from pytest_libero_max.substrates.libero.installation import Installation
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.worlds.robot import CAMERAS
from tests.substrates.libero.checkouts import SUITE, plus_checkout, pro_checkout
from tests.substrates.libero.data import DATA, needs_package
from tests.substrates.libero.made_up import case_of, pro_case
from tests.worlds.states import differing, every_array, random_actions


def first_of(source: str, category: str) -> Variation:
    """The first variation of a category that varies ``libero_object/0``."""
    return next(
        variation
        for variation in catalogue(source)
        if (variation.category, variation.suite, variation.base_index) == (category, SUITE, 0)
    )


def own_case(source: str, category: str) -> Case:
    """A case that plays it."""
    variation = first_of(source, category)
    if source == "pro":
        return pro_case(category, SUITE, variation.index)
    named = {"task_name": variation.name, "substrate_difficulty": variation.difficulty}
    return case_of(category, SUITE, variation.index, **named)


@pytest.fixture
def own(installation: Installation) -> LiberoSubstrate:
    return LiberoSubstrate([installation], variation_of=variation_of)


@needs_package
def test_own_variations_change_what_they_are_about(own: LiberoSubstrate) -> None:
    """Made at each reset on LIBERO's scene, and gone with the variation."""
    plain = own.world(case_of(None, SUITE, 0))
    plain.reset(0)
    before, joints, words = every_array(plain.model), plain.observe(())["robot0_joint_pos"], plain.language
    touched: dict[tuple[str, str], list[str]] = {
        ("plus", "Camera Viewpoints"): ["cam_pos", "cam_quat"],
        ("plus", "Light Conditions"): ["light_diffuse"],
        ("plus", "Robot Initial States"): [],
        ("plus", "Language Instructions"): [],
        ("plus", "Sensor Noise"): [],
        ("pro", "semantic"): [],
        ("pro", "camera_view_angle"): ["cam_pos", "cam_quat"],
        ("pro", "visual_noise_glare"): ["light_ambient", "light_diffuse", "light_specular"],
    }
    for (source, category), fields in touched.items():
        case = own_case(source, category)
        world = own.world(case)
        world.reset(0)
        first = world.digest()
        assert differing(before, every_array(world.model)) == fields, category
        moved = not np.array_equal(world.observe(())["robot0_joint_pos"], joints)
        assert moved == (category == "Robot Initial States")
        assert (world.language != words) == (category in ("Language Instructions", "semantic"))
        assert bool(world.filters) == (category in ("Sensor Noise", "visual_noise_glare"))
        world.step(random_actions(0, 1)[0])
        world.reset(0)
        assert world.digest() == first
    plain.varied(None).reset(0)
    assert differing(before, every_array(plain.model)) == []


@needs_package
def test_a_write_under_one_variation_does_not_reach_the_next(own: LiberoSubstrate) -> None:
    """Variations share the scene that they are made on."""
    fresh = own.world(case_of(None, SUITE, 0))
    fresh.reset(0)
    before = every_array(fresh.model)
    world = own.world(own_case("plus", "Camera Viewpoints"))
    world.reset(0)
    world.model.opt.gravity[2] = -1.0
    world.model.geom_friction[:, 0] = 0.0
    world.model.cam_fovy[:] = 20.0  # a field that changes alter: it is set again at each reset
    assert world.take_back_writes() == ("geom_friction", "opt.gravity")
    following = own.world(case_of(None, SUITE, 0))
    following.reset(0)
    assert following.model is world.model
    assert following.model.opt.gravity[2] == pytest.approx(-9.81)
    assert differing(before, every_array(following.model)) == []


@needs_package
def test_another_task_is_looked_at_while_a_pair_is_played(own: LiberoSubstrate) -> None:
    there = case_of(None, SUITE, 1)
    begin_world(there, other := own.world(there))
    first = other.observe(CAMERAS, 64)
    own.close()
    for case in (case_of(None, SUITE, 0), own_case("plus", "Camera Viewpoints")):
        begin_world(case, world := own.world(case))
        before, state = every_array(world.model), world.snapshot()
        SwapImages(CAMERAS, 64, 64, SUITE, 1, 0).apply(world)
        assert differing(before, every_array(world.model)) == []
        shown = world.observe(CAMERAS, 64)
        assert all(np.array_equal(shown[f"{name}_image"], first[f"{name}_image"]) for name in CAMERAS)
        assert set(world.snapshot().differing(state)) == {
            "controller",
            "filters",
        }  # the next look is a fresh one


@needs_package
@pytest.mark.parametrize(
    ("source", "category"), [("plus", "Background Textures"), ("pro", "object"), ("pro", "view_occlusion")]
)
def test_what_needs_a_scene_of_its_own_is_refused(own: LiberoSubstrate, source: str, category: str) -> None:
    with pytest.raises(SubstrateError, match=r"\(\w+\).*variations=installed"):
        own.world(own_case(source, category))


@needs_package
def test_own_variations_are_labelled_and_asked_for(installation: Installation) -> None:
    asked = SubstrateOptions((installation.root,), DATA / "assets", variations="own")
    substrate = open_substrate("libero", asked)
    assert substrate.fingerprint()["source_variations"] == "own"
    plain = open_substrate("libero", SubstrateOptions((installation.root,), DATA / "assets"))
    assert plain.fingerprint()["source_variations"] == "installed"


@needs_package
def test_each_source_is_played_by_its_installation(installation: Installation, tmp_path: Path) -> None:
    """All in one process, by turns: none of them changes what another does."""
    plus = plus_checkout(installation, tmp_path / "plus")
    pro = pro_checkout(installation, tmp_path / "pro")
    substrate = LiberoSubstrate([plus, installation, pro])
    assert [substrate.installation_for(source) for source in ("libero", "plus", "pro")] == [
        installation,
        plus,
        pro,
    ]
    cases = [
        case_of(None, SUITE, 0),
        case_of("Background Textures", SUITE, 0),
        pro_case("task", SUITE, 0),
        pro_case("view_occlusion", SUITE, 0),
    ]
    digests = []
    for _ in range(2):
        for case in cases:
            substrate.world(case).reset(0)
        for action in random_actions(0, 4):
            for case in cases:
                substrate.world(case).step(action)
        digests.append([substrate.world(case).digest() for case in cases])
    assert digests[0] == digests[1]
    assert len(set(digests[0])) == 4
    alone = LiberoSubstrate([pro])
    world = alone.world(cases[2])
    world.reset(0)
    for action in random_actions(0, 4):
        world.step(action)
    assert world.digest() == digests[0][2]


@needs_package
def test_what_a_scene_is_made_of_and_is_not_there_is_named(
    installation: Installation, tmp_path: Path
) -> None:
    substrate = LiberoSubstrate([plus_checkout(installation, tmp_path)])
    with pytest.raises(SubstrateError, match=r"/yellow_book\.xml'.*assets\.zip"):
        substrate.plus_world(SUITE, 1, 195)


@needs_package
def test_a_source_without_its_installation_is_refused(installation: Installation) -> None:
    with pytest.raises(SubstrateError, match=r"source 'plus' .*hf-libero"):
        LiberoSubstrate([installation]).world(case_of("Light Conditions", SUITE, 0))
