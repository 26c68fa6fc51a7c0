"""The embedded substrate: LIBERO's tasks in scenes of our own, on the installed robosuite."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache, partial
from importlib.metadata import version
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pytest_libero_max.machine import return_free_memory
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.embedded.catalogue.lookup import variation_of
from pytest_libero_max.substrates.embedded.placement import initial_state
from pytest_libero_max.substrates.embedded.predicates import Predicate, all_hold
from pytest_libero_max.substrates.embedded.remodel import Remodel, remodelled, waiting_place
from pytest_libero_max.substrates.embedded.scene import (
    Scene,
    build_scene,
    graspable_parts,
    joints_of,
    resolve,
)
from pytest_libero_max.substrates.kept_worlds import KeptWorlds
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.worlds import threads
from pytest_libero_max.worlds.contract import Array, Goal
from pytest_libero_max.worlds.privileged import Fact, GraspablePart, facts
from pytest_libero_max.worlds.rendering import context, gl
from pytest_libero_max.worlds.robosuite_world import RobosuiteWorld

gl.prepare()

import mujoco  # noqa: E402

from pytest_libero_max.substrates.embedded.env import SceneEnv  # noqa: E402
from pytest_libero_max.worlds.rendering.renderer import OFFSAMPLES, Renderer  # noqa: E402

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case

NAME = "embedded"
IMAGES = "images"
"""Fingerprint: version of the images. Records from before it have none, and version 1."""

SCENES = 12
"""Number of compiled scenes that a substrate keeps."""

SAMPLES = MappingProxyType({"1": OFFSAMPLES, "2": 0})
"""Samples per pixel by version of the images: half of the time of an image is a software renderer's work on
samples, and without them only edges look otherwise."""

Starts = Callable[[int], Mapping[str, Array]]
_AS_IT_IS = Remodel()
_scene = lru_cache(maxsize=2)(build_scene)  # a remodelled scene needs it twice, once for its starts
_RESULT_PACKAGES = ("mujoco", "robosuite", "numpy", "scipy", "numba", "opencv-python-headless")


class EmbeddedWorld(RobosuiteWorld):
    """One embedded scene with its robot.

    The first reset to an initial state lays it out and lets it settle; later ones copy the result.

    Args:
        plan: Differences from the unmodified task's scene, if it was remodelled.
        starts: Origin of the initial states of a remodelled scene: joint positions of the unmodified
            one by joint name.
        images: Version of the images, see :data:`SAMPLES`.
    """

    def __init__(
        self,
        task: Scene,
        plan: Remodel = _AS_IT_IS,
        starts: Starts | None = None,
        *,
        images: str = SubstrateOptions.images,
    ) -> None:
        name = f"{NAME}/{task.key}" + (f"+{plan.key}" if plan.key else "")
        super().__init__(name, task.language, SceneEnv(task), task.entities)
        self._task = task
        self._plan = plan
        self._samples = SAMPLES[images]
        self._given = starts
        self._starts: dict[int, Array] = {}
        self._variation: Variation | None = None
        self._renderer = self._new_renderer()  # it opens nothing yet; the worlds of a scene share it
        self.reset(0)

    def _new_renderer(self) -> Renderer:
        return Renderer(self._model, self._data, samples=self._samples)

    def varied(self, variation: Variation | None) -> EmbeddedWorld:
        """Return the same scene under a source variation, which every reset applies.

        All worlds that come from one scene share its simulator: play them one after the other, each from
        its own reset.
        """
        world = copy.copy(self)
        world._variation = variation
        return world

    @property
    def goal(self) -> tuple[Fact, ...]:
        """Facts that must all hold at the end, in the task's own words: for policies that are privileged."""
        assigned = self._assigned[1]
        return self._task.task.goal if assigned is None else facts(assigned)

    def _task_fields(self) -> Mapping[str, Any]:
        facts_and_rules = zip(self._task.task.goal, self._task.goal, strict=True)
        return {
            "goal": [(fact.words(), vars(rule)) for fact, rule in facts_and_rules],
            "graspable_parts": {name: vars(part) for name, part in self.graspable_parts.items()},
        }

    def holds(self, fact: Fact) -> bool:
        """Return True if a predicate holds now, by the rules of the goal."""
        return self._predicate(fact).holds(self._model, self._data)

    def joints(self, name: str) -> tuple[str, ...]:
        """Return the joints of a fixture, or those that a region of it moves with; none for other places."""
        if name in self._task.regions or self._entities[name].kind == "fixture":
            return joints_of(name, self._task.entities, self._task.regions)
        return ()

    @cached_property
    def graspable_parts(self) -> Mapping[str, GraspablePart]:
        """The parts that are made to be held, by name: for policies that are privileged."""
        return graspable_parts(self._task)

    def reset(self, init: int) -> None:
        super().reset(init)
        for number, (name, _) in enumerate(self._plan.extras):
            self.park(name, waiting_place(number))
        if self._variation is not None:
            self._variation.apply(self)

    def start(self, init: int) -> dict[str, Array]:
        """Joint positions of an initial state by joint name, without any source variation."""
        qpos = self._initial_qpos(init)
        ends = [*self._model.jnt_qposadr[1:], self._model.nq]
        return {
            self._model.joint(number).name: qpos[self._model.jnt_qposadr[number] : end].copy()
            for number, end in enumerate(ends)
        }

    def succeeded(self) -> bool:
        assigned = self._assigned[1]
        goal = self._task.goal if assigned is None else self._resolved(assigned)
        return all_hold(goal, self._model, self._data)

    def _check_goal(self, goal: Goal) -> None:
        self._resolved(goal)

    def _resolved(self, goal: Goal) -> tuple[Predicate, ...]:
        return tuple(self._predicate(fact) for fact in facts(goal))

    def _predicate(self, fact: Fact) -> Predicate:
        return resolve(fact, self._task.entities, self._task.regions)

    def _initial_qpos(self, init: int) -> Array:
        if init not in self._starts:
            if self._given is None:
                # Initial states belong to the compiled scene, whatever an event has done to it since.
                self._write_model(self._compiled)
                scratch = mujoco.MjData(self._model)
                self._starts[init] = initial_state(self._task, self._model, scratch, init)
            else:
                self._starts[init] = self._adapted(self._given(init))
        return self._starts[init]

    def _adapted(self, start: Mapping[str, Array]) -> Array:
        """Return the unmodified scene's initial state in this one, joint by joint; additions keep qpos0."""
        qpos: Array = self._model.qpos0.copy()
        for name, values in start.items():
            address = int(self._model.joint(self._plan.renamed(name)).qposadr[0])
            qpos[address : address + values.size] = values
        return qpos


class EmbeddedSubstrate:
    """Builds the scenes of tasks and of their source variations, and keeps those used last.

    Args:
        scenes: Largest number of compiled scenes kept; each takes some 20 MB, and 0.2 s to build anew.
        images: Version of the images, see :data:`SAMPLES`.
    """

    name = NAME

    def __init__(self, scenes: int = SCENES, *, images: str = SubstrateOptions.images) -> None:
        self._images = images
        self._limit = max(scenes, 2)  # a remodelled scene and the one that it takes its starts from
        self._worlds = KeptWorlds[tuple[str, int, Remodel], EmbeddedWorld]()
        self._starts: dict[tuple[str, int, int], Mapping[str, Array]] = {}

    def world(self, case: Case) -> EmbeddedWorld:
        if case.unmodified:
            return self._task_world(case.suite, case.task_index)
        return self.varied_world(variation_of(case))

    def varied_world(self, variation: Variation) -> EmbeddedWorld:
        """Return the world that plays a source variation."""
        plan = Remodel.from_dict(variation.scene)
        return self._world(variation.suite, variation.base_index, plan).varied(variation)

    def _world(self, suite: str, index: int, plan: Remodel) -> EmbeddedWorld:
        key = (suite, index, plan)
        kept = self._worlds.used(key)
        if kept is not None:
            return kept
        scene = _scene(suite, index)
        if plan == _AS_IT_IS:
            world = EmbeddedWorld(scene, images=self._images)
        else:
            starts = partial(self._start, suite, index)
            starts(0)  # now, so that the unmodified scene is not built in the middle of building this one
            world = EmbeddedWorld(remodelled(scene, plan), plan, starts, images=self._images)
        world.open_task = self._task_world
        self._worlds[key] = world
        if self._worlds.shrink(self._limit):
            return_free_memory()
        return world

    def _task_world(self, suite: str, index: int) -> EmbeddedWorld:
        return self._world(suite, index, _AS_IT_IS)

    def _start(self, suite: str, index: int, init: int) -> Mapping[str, Array]:
        key = (suite, index, init)
        if key not in self._starts:
            self._starts[key] = self._task_world(suite, index).start(init)
        return self._starts[key]

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        """Return the versions of the packages that compute results, the GL backend and the BLAS.

        Args:
            images: True to return the version of the images as well, and
                :func:`what draws them <pytest_libero_max.worlds.rendering.context.fingerprint>`.
        """
        drawn = {**context.fingerprint(images), **({IMAGES: self._images} if images else {})}
        return {"substrate": NAME, **self._packages, **drawn, **self._blas}

    @cached_property
    def _packages(self) -> Mapping[str, str]:
        return {package: version(package) for package in _RESULT_PACKAGES}

    @cached_property
    def _blas(self) -> Mapping[str, str]:
        return threads.fingerprint()

    def close(self) -> None:
        self._worlds.close()
