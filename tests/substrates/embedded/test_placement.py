from __future__ import annotations

import subprocess
import sys

import mujoco
import numpy as np
import pytest

from pytest_libero_max.benchmark.identity import FROZEN_STATES, TRAINING_STATES
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.substrates.embedded.placement import initial_state
from pytest_libero_max.substrates.embedded.predicates import touching
from pytest_libero_max.substrates.embedded.scene import build_scene, resolve
from pytest_libero_max.tasks.libero_tasks import category_of

from .scenes import ALL, IDS, at_start, compiled, control_steps

STATES = (*FROZEN_STATES, *TRAINING_STATES[::10])

every_scene = pytest.mark.parametrize(("suite", "index"), ALL, ids=IDS)

PRINT_DIGEST = """
import hashlib, mujoco
from pytest_libero_max.substrates.embedded.placement import initial_state
from pytest_libero_max.substrates.embedded.scene import build_scene
scene = build_scene("libero_spatial", 5)
model = mujoco.MjModel.from_xml_string(scene.mjcf)
print(hashlib.sha256(initial_state(scene, model, mujoco.MjData(model), 3).tobytes()).hexdigest())
"""


@every_scene
def test_every_start_is_finite_rounded_and_its_own(suite: str, index: int) -> None:
    starts = [at_start(suite, index, init)[2].qpos.copy() for init in STATES]
    for qpos in starts:
        assert np.isfinite(qpos).all()
        assert (np.round(qpos, 6) == qpos).all()
        assert not (np.signbit(qpos) & (qpos == 0)).any()
    assert len({qpos.tobytes() for qpos in starts}) == len(STATES)


@every_scene
def test_every_start_is_at_rest(suite: str, index: int) -> None:
    for init in STATES:
        _, model, data = at_start(suite, index, init)
        before = data.xpos.copy()
        control_steps(model, data, 20)
        mujoco.mj_forward(model, data)
        assert np.linalg.norm(data.xpos - before, axis=1).max() < 0.001
        assert np.isfinite(data.qacc).all()


@every_scene
def test_everything_touches_what_it_is_declared_to_rest_on_and_nothing_else(suite: str, index: int) -> None:
    for init in STATES:
        scene, model, data = at_start(suite, index, init)
        for name in scene.task.objects:
            for other, entity in scene.entities.items():
                related = scene.entities[name].support == other or entity.support == name
                if other != name:
                    assert touching(model, data, scene.entities[name].body, entity.body) == related, (
                        init,
                        name,
                        other,
                    )


@every_scene
def test_objects_stand_upright_in_their_regions(suite: str, index: int) -> None:
    for init in STATES:
        scene, _, data = at_start(suite, index, init)
        for fact in scene.task.start:
            if (
                fact.subject in scene.task.objects
                and fact.place is not None
                and fact.place in scene.task.places
            ):
                x0, y0, x1, y1 = scene.task.places[fact.place].box
                x, y, _ = data.body(scene.entities[fact.subject].body).xpos
                # LIBERO shrinks a region by a nominal radius; of a smaller region the middle may leave it.
                margin = category(category_of(fact.subject)).spread_margin
                for low, value, high in ((x0, x, x1), (y0, y, y1)):
                    reach = max(high - low, abs(high - low - 2 * margin)) / 2 + 0.0005
                    assert abs(value - (low + high) / 2) <= reach, (init, fact)


@every_scene
def test_what_the_task_says_about_its_start_holds(suite: str, index: int) -> None:
    for init in STATES:
        scene, model, data = at_start(suite, index, init)
        for fact in scene.task.start:
            fixed = fact.subject in scene.task.fixtures or fact.place in scene.task.places
            if not fixed:
                assert resolve(fact, scene.entities, scene.regions).holds(model, data), (init, fact)


def test_an_initial_state_does_not_depend_on_what_was_asked_before() -> None:
    scene, model = compiled("libero_spatial", 4)
    data = mujoco.MjData(model)
    forwards = [initial_state(scene, model, data, init).tobytes() for init in (0, 1, 2)]
    control_steps(model, data, 3)
    backwards = [initial_state(scene, model, data, init).tobytes() for init in (2, 1, 0)]
    assert forwards == backwards[::-1]


def test_laying_out_leaves_the_model_as_it_was() -> None:
    scene = build_scene("libero_spatial", 3)
    model = mujoco.MjModel.from_xml_string(scene.mjcf)
    margin, friction = model.geom_margin.copy(), model.geom_friction.copy()
    initial_state(scene, model, mujoco.MjData(model), 0)
    assert (model.geom_margin == margin).all()
    assert (model.geom_friction == friction).all()


def test_other_processes_with_other_hash_seeds_find_the_same_bytes() -> None:
    digests = {
        subprocess.run(
            [sys.executable, "-c", PRINT_DIGEST],
            capture_output=True,
            text=True,
            check=True,
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": ":".join(path for path in sys.path if path)},
        ).stdout
        for seed in ("1", "2")
    }
    assert len(digests) == 1


@pytest.mark.parametrize("init", [-1, 50, 1000])
def test_initial_states_that_do_not_exist_are_refused(init: int) -> None:
    scene, model = compiled("libero_object", 0)
    with pytest.raises(SubstrateError, match=f"init={init} .*libero_object/0: .*0 to 9"):
        initial_state(scene, model, mujoco.MjData(model), init)
