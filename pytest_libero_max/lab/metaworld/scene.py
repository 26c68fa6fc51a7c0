"""An environment of the package ``metaworld`` as a scene: built, upright, with names for its things."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.lab.metaworld.robot import MAIN_CAMERA, SAWYER, lacking_packages
from pytest_libero_max.lab.metaworld.spares import SPARES, add_to
from pytest_libero_max.lab.metaworld.tasks import TABLE, Task
from pytest_libero_max.worlds.contract import Entity, EntityKind
from pytest_libero_max.worlds.rendering import gl

gl.prepare()

import mujoco  # noqa: E402

_MAIN_CAMERA_AT_M = (0.75, 0.075, 0.7)
"""Place to which the field's evaluations move this camera."""
_TABLE_BODY, _MOCAP_BODY = "tablelink", "mocap"
_FOREVER = 2**31


def build(task: Task, spares: Collection[str]) -> Any:
    """Return the environment of a task and some spare objects, whose places its own generator draws.

    Raises:
        SubstrateError: The package is not installed.
    """
    missing = lacking_packages()
    if missing:
        raise SubstrateError(f"Meta-World cannot be played: {missing}.")
    from metaworld.env_dict import ALL_V3_ENVIRONMENTS

    kind = ALL_V3_ENVIRONMENTS[task.name]
    env: Any = (kind if not spares else _with_spares(kind, spares))()
    # What set_task() does, but that places are not frozen: draws come from the generator that a reset seeds.
    env._set_task_called, env._partially_observable = True, False
    env._freeze_rand_vec, env.seeded_rand_vec = False, True
    vars(env).pop("sawyer_observation_space", None)  # cached with bounds that hide the goal
    env.max_path_length = _FOREVER  # budgets are ours
    _turn_upright(env.model)
    return env


def _with_spares(kind: Any, spares: Collection[str]) -> Any:
    def initialize(self: Any) -> tuple[mujoco.MjModel, mujoco.MjData]:
        spec = mujoco.MjSpec.from_file(self.fullpath)
        add_to(spec, spares)
        model = spec.compile()
        model.vis.global_.offwidth, model.vis.global_.offheight = self.width, self.height
        return model, mujoco.MjData(model)

    return type(kind.__name__, (kind,), {"_initialize_simulation": initialize})


def _turn_upright(model: mujoco.MjModel) -> None:
    """Move the main camera to where the field has it, and turn its picture, which is upside down, upright."""
    number = int(model.camera(MAIN_CAMERA).id)
    model.cam_pos[number] = _MAIN_CAMERA_AT_M
    w, x, y, z = model.cam_quat[number].tolist()
    model.cam_quat[number] = (-z, y, -x, w)  # half a turn about the axis of view


def entities_of(model: mujoco.MjModel, task: Task, spares: Collection[str]) -> dict[str, Entity]:
    """Return what a case can name: things of the task, spare objects, and what else stands there."""
    entities = [Entity(TABLE, TABLE, "surface", _TABLE_BODY)]
    for thing in task.things.values():
        kind: EntityKind = "object" if thing.free else "fixture"
        entities.append(Entity(thing.name, thing.name, kind, thing.body, TABLE if thing.body else None))
    if task.part is not None:
        entities.append(Entity(task.part.name, task.part.name, "fixture", task.part.body))
    entities += [
        Entity(spare.name, spare.name, "object", spare.body, TABLE)
        for spare in SPARES
        if spare.name in spares
    ]
    named = {entity.body for entity in entities}
    entities += [_other(model, body) for body in _standing(model) if model.body(body).name not in named]
    return {entity.name: entity for entity in entities}


def _standing(model: mujoco.MjModel) -> Iterator[int]:
    """Yield the bodies with a name that stand in the world by themselves, without the robot."""
    for body in range(1, model.nbody):
        name = model.body(body).name
        if int(model.body_parentid[body]) == 0 and name and name not in (SAWYER.base_body, _MOCAP_BODY):
            yield body


def _other(model: mujoco.MjModel, body: int) -> Entity:
    name = model.body(body).name
    label = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    first = int(model.body_jntadr[body])
    free = first >= 0 and model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE
    return Entity(label, label, "object" if free else "fixture", name, TABLE)


def numeric_fields(env: Any) -> dict[str, NDArray[Any]]:
    """Return copies of what an environment keeps beside its simulator, by the names of its attributes.

    These are numbers, arrays of numbers, and those that are still None (an empty array). Views of the
    simulator's own memory are left out: they follow from its state.
    """
    fields = {name: _array(value, env.data) for name, value in vars(env).items()}
    return {name: array for name, array in sorted(fields.items()) if array is not None}


def _array(value: Any, data: mujoco.MjData) -> NDArray[Any] | None:
    if value is None:
        return np.empty(0)
    if isinstance(value, np.ndarray):
        views = (data.xpos, data.xquat, data.site_xpos, data.geom_xpos)
        is_view = any(np.may_share_memory(value, memory) for memory in views)
        return None if is_view or value.dtype.kind not in "biuf" else value.copy()
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(isinstance(number, bool | int | float | np.generic) for number in numbers):
        return None
    return np.array(value)


def write_fields(env: Any, fields: dict[str, NDArray[Any]]) -> None:
    """Write back what :func:`numeric_fields` returned; what has been added since goes."""
    for name in numeric_fields(env).keys() - fields.keys():
        delattr(env, name)
    for name, array in fields.items():
        value: Any = array.copy()
        if array.ndim == 0:
            value = array.item()
        elif array.size == 0:
            value = None
        setattr(env, name, value)
