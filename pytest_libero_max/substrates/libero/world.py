"""A genuine scene in our own loop, with the states, images and success of the package's own step.

The package's control step does more than its physics: it samples observations in the middle of the step
and judges success before the step is quite over. Its results are reproduced:

- the first control step after a reset starts from the kinematics of the pose of the *reset*, because the
  package sets the initial state without telling the controller;
- observations are sampled at one substep of 25: the 25th after a reset. Each observation that is forced
  between steps moves the sampling one substep earlier from then on. An evaluation that sets the initial state
  and nothing else samples at the 24th. The authors' runner forces three more before the first step, two to
  see that the renderer is steady and one after the setup, and samples at the 21st. Poses and images are those
  of the beginning of that substep, joint values those of its end;
- success is judged with the positions and contacts of the beginning of the last substep.

An observation between steps shows the values sampled in the last step. If something was altered since, it
shows the present world, as after the package's forced update.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import EntityError, SubstrateError, counted, did_you_mean
from pytest_libero_max.substrates.libero.graspable_parts import graspable_parts_of
from pytest_libero_max.substrates.libero.package_env import Built
from pytest_libero_max.worlds.contract import (
    Array,
    Entity,
    EntityKind,
    Goal,
    Image,
    ImageSize,
    Semantics,
)
from pytest_libero_max.worlds.privileged import Fact, GraspablePart, facts
from pytest_libero_max.worlds.rendering.renderer import Renderer
from pytest_libero_max.worlds.robosuite_world import RobosuiteWorld
from pytest_libero_max.worlds.robot import PANDA, ROBOT

import mujoco  # isort: skip - the rooms above have settled its backend

_LINEAR = 1
"""``mjCOLORSPACE_LINEAR``: textures as they are, which is how MuJoCo before 3.3.3 showed all of them."""

_SEEN = MappingProxyType(PANDA.state)

_RUNNERS_LOOKS = 3
"""Fresh observations that the authors' runner asks for between ``set_init_state`` and the first step: two
that have to show the same image, and one after the setup, whether or not there is one."""

_PIN = 8
"""Length of a pinned object's state: address in the joint positions (0: the arm is there), pose."""


class LiberoWorld(RobosuiteWorld):
    """One task of an installation.

    Args:
        built: Its environment, after a seeded reset; nobody else may use it from now on.
        states: (n, 1 + nq + nv) initial states.
        semantics: ``published``: objects taken out are put where the authors put them, inside the floor,
            and come back as they then are; what is moved keeps its share of the solver's warm start; the
            forced observations of the authors' runner, before the first step and after an event, shift the
            sampling. ``corrected``: none of these.
        noise: Noise that the package's wrapper puts on what a step returns: image, camera, steps since reset.
    """

    def __init__(
        self,
        scene: str,
        language: str,
        built: Built,
        states: Array,
        semantics: Semantics = "published",
        noise: Callable[[Image, str, int], Image] | None = None,
    ) -> None:
        env = built.env
        super().__init__(scene, language, env, entities_of(env))
        self._semantics = semantics
        self._states = states
        expected = 1 + self._model.nq + self._model.nv
        if states.shape[1] != expected:
            raise SubstrateError(
                f"{scene}: an initial state has {counted(states.shape[1], 'number')}, but the scene has "
                f"{expected} (time, positions and velocities). They are not of the same task or installation."
            )
        self._kinematics = _kinematics(env.robots[0].controller)
        self._seen = {name: np.zeros(size) for name, size in _SEEN.items()}
        self._seen_qpos = np.zeros(self._model.nq)
        self._sample_at = 0
        self._fresh = True
        self._solved = False
        self._stale = True
        self._asked = False
        self._vary: Callable[[LiberoWorld], object] | None = None
        self._pinned = np.zeros(_PIN)
        self._noise = noise
        self._view: mujoco.MjData | None = None
        if hasattr(
            self._model, "tex_colorspace"
        ):  # MuJoCo from 3.3.3 on draws textures tagged as sRGB darker
            self._model.tex_colorspace[:] = _LINEAR
        self.reset(0)

    @property
    def semantics(self) -> Semantics:
        return self._semantics

    @property
    def problem(self) -> Mapping[str, Any]:
        """The task description as the package has read it, names in lower case."""
        problem: Mapping[str, Any] = self._env.parsed_problem
        return problem

    @property
    def goal(self) -> tuple[Fact, ...]:
        """Facts that must all hold at the end, for policies that are privileged."""
        assigned = self._assigned[1]
        return facts(self._env.parsed_problem["goal_state"] if assigned is None else assigned)

    def _task_fields(self) -> Mapping[str, Any]:
        parts = {name: vars(part) for name, part in self.graspable_parts.items()}
        return {"goal": self._env.parsed_problem["goal_state"], "graspable_parts": parts}

    def holds(self, fact: Fact) -> bool:
        """Return True if a predicate holds now; the package decides."""
        return bool(self._env._eval_predicate(list(fact.words())))

    def joints(self, name: str) -> tuple[str, ...]:
        """Return the joints of a fixture, or those that a region of it moves with; none for other places.

        Raises:
            EntityError: There is no such entity or region.
        """
        if name in self._entities:
            fixture = self._entities[name].kind == "fixture"
            return tuple(self._env.fixtures_dict[name].joints) if fixture else ()
        regions = self._env.object_sites_dict
        if name not in regions:
            hint = did_you_mean(name, [*self._entities, *regions])
            raise EntityError(f"{self._scene} has no entity or region {name!r}. {hint}")
        return tuple(regions[name].joints or ())

    @cached_property
    def graspable_parts(self) -> Mapping[str, GraspablePart]:
        """Handles and knobs by name, for policies that are privileged."""
        return graspable_parts_of(self._env, self._model)

    def varied(self, vary: Callable[[LiberoWorld], object] | None) -> LiberoWorld:
        """Return this world; from now on every reset applies a source variation."""
        self._vary = vary
        return self

    def reset(self, init: int) -> None:
        super().reset(init)
        if self._vary is not None:
            self._vary(self)
            self.look()

    def look(self) -> None:
        """Force an observation, as a source variation does in the middle of its changes."""
        self._after_alteration()
        self._sample_earlier()

    def pin(self, entity: str) -> None:
        """Put an object back to where it is now after every step, until the next reset; its speed stays."""
        address = self._qpos_address(self._free(entity))
        self._pinned[:] = (address, *self._data.qpos[address : address + 7])

    def radius(self, entity: str) -> float | None:
        """Return the package's nominal horizontal radius of an object, m; None for other entities."""
        item = self._env.objects_dict.get(self._known(entity))
        return None if item is None else float(np.ravel(item.horizontal_radius)[0])

    def initial_state(self, init: int) -> Array:
        """(1 + nq + nv,) time, positions and velocities, as the package's ``set_init_state`` takes them."""
        self._initial_qpos(init)
        state: Array = self._states[init].copy()
        return state

    def succeeded(self) -> bool:
        return self._holds() if self._fresh and not self._pinned[0] else self._solved

    def end_effector(self) -> Array:
        return super().end_effector() if self._fresh else self._seen[f"{ROBOT}_eef_pos"].copy()

    def park(self, entity: str, position: Sequence[float] | Array) -> None:
        if self._semantics == "published":
            at, orientation = self.pose(self._free(entity))
            super().place(entity, position)
            self._parked[entity] = (*at.tolist(), *orientation.tolist())
        else:
            super().park(entity, position)

    def unpark(
        self,
        entity: str,
        position: Sequence[float] | Array,
        quaternion: Sequence[float] | Array | None = None,
    ) -> None:
        if self._semantics == "published":
            self.parked_pose(entity)
            before = self._parked.pop(entity)
            try:
                super().place(entity, position, quaternion)
            except SubstrateError:
                self._parked[entity] = before
                raise
        else:
            super().unpark(entity, position, quaternion)

    def pose_arm(self, joints: Sequence[float] | Array) -> None:
        super().pose_arm(joints)
        self._stale = False
        self._stepper.start()

    # One control step.

    def _control_step(self, action: Array) -> bool:
        stepper = self._stepper
        if self._steps:  # the look after the setup is one of those that every episode begins with
            self._sample_earlier()
        self._asked = self._fresh = False
        self._env._post_process()  # what the last step did to a burner's glow is seen from this one on
        goal, played = self._begin(action)
        ahead = self._sample_at - 1 - played
        if ahead > 0:
            stepper.play(goal, action, ahead)
        if ahead >= 0:
            self._seen_qpos[:] = self._data.qpos
            stepper.play(goal, action, 1, settle=False)
        self._sample()
        left = stepper.substeps - max(self._sample_at, played)
        if left:
            self._settle()
            stepper.play(goal, action, left, settle=False)
        self._solved = self._holds()
        self._settle()
        if self._pinned[0]:
            self._put_back()
        return False

    def _put_back(self) -> None:
        """Return the pinned object to its place and observe again, as the runtime does."""
        address = int(self._pinned[0])
        self._data.qpos[address : address + 7] = self._pinned[1:]
        self._settle()
        self._after_alteration()
        self._asked = False  # what a step returns is always that look, so it does not matter when one is due

    def _begin(self, action: Array) -> tuple[Array, int]:
        """Return the goal of the step, and how many substeps have been played to get it."""
        stepper = self._stepper
        if not self._stale:
            return stepper.aim(action, self._control), 0
        self._stale = False
        robot = self._env.robots[0]
        for name, value in self._kinematics.items():
            setattr(robot.controller, name, value.copy(order="K"))
        robot.controller.new_update = False
        robot.controller.use_delta = self._control == "delta"
        robot.gripper.current_action = np.zeros(2)
        self._seen_qpos[:] = self._data.qpos
        robot.control(action, policy_step=True)
        stepper.restore(np.concatenate([robot.controller.goal_ori.ravel(), robot.gripper.current_action]))
        goal: Array = np.array(robot.controller.goal_pos)
        mujoco.mj_step2(self._model, self._data)
        if self._sample_at > 1:
            self._settle()
        return goal, 1

    def _sample_earlier(self) -> None:
        """Shift later sampling times by one substep if an alteration was observed since the last step."""
        if self._asked and self._semantics == "published":
            self._sample_at = (self._sample_at - 2) % self._stepper.substeps + 1
        self._asked = False

    def _sample(self) -> None:
        for name, value in super()._proprioception().items():
            self._seen[name][:] = value
        self._seen[f"{ROBOT}_eef_pos"][:] = super().end_effector()

    def _after_alteration(self) -> None:
        """Note that the world was altered: until the next step, an observation shows it as it is now."""
        self._fresh = self._asked = True
        self._env._post_process()

    def _holds(self) -> bool:
        goal = self._assigned[1]
        if goal is None:
            return bool(self._env._check_success())
        return all(self._env._eval_predicate(list(fact)) for fact in goal)

    # What the base class asks for.

    def _check_goal(self, goal: Goal) -> None:
        known = self._env.object_states_dict
        for fact in facts(goal):
            for name in fact.words()[1:]:
                if name not in known:
                    raise EntityError(f"{self._scene} has no {name!r}. {did_you_mean(name, known)}")

    def _initial_qpos(self, init: int) -> Array:
        if not 0 <= init < len(self._states):
            raise SubstrateError(
                f"{self._scene} has the initial states 0 to {len(self._states) - 1}, but {init} was asked "
                "for."
            )
        return self._states[init, 1 : 1 + self._model.nq]

    def _write_start(self, qpos: Array) -> None:
        self._data.qpos[:] = qpos  # not normalised: the package does not, and the first step would show it

    def _write_pose(self, name: str, position: Array, quaternion: Array | None) -> None:
        warm_start = self._data.qacc_warmstart.copy()
        super()._write_pose(name, position, quaternion)
        if self._semantics == "published":
            self._data.qacc_warmstart[:] = warm_start  # the authors move an object and leave the solver alone

    def _reset_controller(self) -> None:
        start = np.concatenate([np.ravel(self._kinematics["goal_ori"]), np.zeros(2)])
        self._stepper.restore(start)
        # A reset samples at the last substep, and setting the initial state samples out of turn.
        looks = 1 + (_RUNNERS_LOOKS if self._semantics == "published" else 0)
        self._sample_at = self._stepper.substeps - looks
        self._solved, self._stale = False, True
        self._pinned[:] = 0.0
        for seen in (self._seen_qpos, *self._seen.values()):
            seen[:] = 0.0
        self._after_alteration()
        self._asked = False

    def _controller_state(self) -> Array:
        switches = (self._fresh, self._solved, self._stale, self._asked)
        flags = [float(flag) for flag in (self._sample_at, *switches)]
        return np.concatenate(
            [super()._controller_state(), flags, self._pinned, self._seen_qpos, *self._seen.values()]
        )

    def _set_controller_state(self, state: Array) -> None:
        stepper, flags, pinned, qpos, *seen = np.split(
            state, np.cumsum([11, 5, _PIN, self._seen_qpos.size, *list(_SEEN.values())[:-1]])
        )
        super()._set_controller_state(stepper)
        self._sample_at = int(flags[0])
        self._fresh, self._solved, self._stale, self._asked = (bool(flag) for flag in flags[1:])
        self._pinned[:] = pinned
        self._seen_qpos[:] = qpos
        for name, value in zip(self._seen, seen, strict=True):
            self._seen[name][:] = value

    def _proprioception(self) -> dict[str, Array]:
        if self._fresh:
            return super()._proprioception()
        return {name: value.copy() for name, value in self._seen.items()}

    def _new_renderer(self) -> Renderer:
        self._view = mujoco.MjData(self._model)
        return Renderer(self._model, self._view, reflections=True, thrifty=True)

    def _image(self, camera: str, size: ImageSize) -> Image:
        self._look()
        return super()._image(camera, size)

    def _segmented(self, camera: str, size: int) -> NDArray[np.intp]:
        self._look()
        return super()._segmented(camera, size)

    def _look(self) -> None:
        """Set the drawn state to the time at which LIBERO samples its observations."""
        if self._renderer is None:
            self._renderer = self._new_renderer()
        assert self._view is not None
        self._view.qpos[:] = self._data.qpos if self._fresh else self._seen_qpos
        mujoco.mj_kinematics(self._model, self._view)
        mujoco.mj_camlight(self._model, self._view)

    def _drawn(self, camera: str, size: ImageSize) -> Image:
        image = super()._drawn(camera, size)
        # A look out of turn is taken from the environment inside the wrapper, which adds the noise.
        return image if self._noise is None or self._fresh else self._noise(image, camera, self._steps)

    def rest(self, *, shareable: bool) -> None:
        """See :meth:`.Renderer.rest`."""
        if self._renderer is not None:
            self._renderer.rest(shareable=shareable)

    def close(self) -> None:
        # robosuite would collect the garbage of the whole process here; it is collected once, before a build.
        self._env.sim = None
        super().close()
        self._view = None


def entities_of(env: Any) -> dict[str, Entity]:
    """Entities of a scene: objects in the order of their joints, then fixtures, then the work surface."""
    supports = _supports(env.parsed_problem)
    bodies = set(env.sim.model.body_names)
    entities = {}
    kinds: tuple[tuple[EntityKind, Any], ...] = (("object", env.objects_dict), ("fixture", env.fixtures_dict))
    for kind, items in kinds:
        for name, item in items.items():
            entities[name] = Entity(name, item.category_name, kind, item.root_body, supports.get(name))
    surface = env.workspace_name
    body = next((name for name in (surface, "table", f"{surface}_col") if name in bodies), "world")
    entities[surface] = Entity(surface, surface, "surface", body)
    return entities


def _supports(problem: Mapping[str, Any]) -> dict[str, str]:
    """Return the entity that each one is declared to rest on, from the task's initial facts."""
    regions = problem["regions"]
    supports = {}
    for predicate, *arguments in problem["initial_state"]:
        if predicate in ("on", "in") and len(arguments) == 2:
            subject, place = arguments
            supports[subject] = regions[place]["target"] if place in regions else place
    return supports


def _kinematics(controller: Any) -> dict[str, Array]:
    """Everything the controller holds right after a reset, which the first substep works with."""
    arrays = {name: value for name, value in vars(controller).items() if isinstance(value, np.ndarray)}
    # The layout in memory is kept: products of differently laid out matrices differ in their last bits.
    return {name: value.copy(order="K") for name, value in arrays.items()}
