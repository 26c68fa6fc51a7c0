"""A substrate as the subject of rules: its worlds, and the cases of its default track that it plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.pairing.changing import begin_world
from pytest_libero_max.substrates.contract import ChosenSubstrate, Substrate, SubstrateKind, SubstrateOptions
from pytest_libero_max.worlds.contract import Array, World
from pytest_libero_max.worlds.robot import ACTION_DIM


def actions_for(world: World) -> Array:
    """Return the (20, d) actions that every world is played with; of the first seed that was tried."""
    size = world.robot.components
    return np.random.default_rng(20).uniform(-1.0, 1.0, (20, max(size, ACTION_DIM)))[:, :size]


@dataclass(frozen=True)
class SubstrateSubject:
    """An open substrate."""

    substrate: Substrate
    cases: tuple[Case, ...]
    """Its examples, or the cases of its default track that can be played here; empty where it plays none."""
    name: str = ""
    """Name by which another process opens it; empty where it is an object of this one."""

    @property
    def case(self) -> Case:
        """The first case that it plays; of a substrate that plays none, the first of the track ``smoke``."""
        return self.cases[0] if self.cases else load_track("smoke").cases[0]

    @property
    def world(self) -> World:
        """The world of that case."""
        return self.substrate.world(self.case)

    def begin(self, case: Case | None = None) -> World:
        """Return the world of a case, by default the first, at the beginning of its episode."""
        case = case or self.case
        world = self.substrate.world(case)
        if self.cases:
            begin_world(case, world)
        else:
            world.reset(0)
        return world

    def case_of(self, event: str) -> Case | None:
        """Return the first case of an event that it plays; None where there is none."""
        return next((case for case in self.cases if case.event.name == event), None)


def open_subject(name: str) -> SubstrateSubject:
    """Open a substrate, see :func:`.chosen_substrate`."""
    from pytest_libero_max.substrates.registry import SUBSTRATES, chosen_substrate
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()
    chosen = chosen_substrate(name)
    kind = SUBSTRATES[chosen.name]
    playable = playable_cases(chosen, name)
    substrate = kind.open(chosen.options)
    # A toy scene has not the entity that the case names.
    fits = playable[0].event.entity in substrate.world(playable[0]).entities
    return SubstrateSubject(substrate, playable if fits else (), name)


def playable_cases(chosen: ChosenSubstrate, name: str) -> tuple[Case, ...]:
    """Return the examples of a substrate; where it has none, the cases of a default track that it plays."""
    from pytest_libero_max.substrates.registry import SUBSTRATES

    kind = SUBSTRATES[chosen.name]
    return tuple(kind.examples(chosen.options)) or _of_tracks(kind, chosen.options, name)


def _of_tracks(kind: SubstrateKind, options: SubstrateOptions, name: str) -> tuple[Case, ...]:
    """Return the cases of the first default track of which some can be played."""
    tracks, reason = kind.tracks(options), ""
    for track in tracks.defaults:
        cases = load_track(tracks.name(track)).cases
        lacking = kind.unplayable(options, cases)
        playable = tuple(case for case in cases if case.case_id not in lacking)
        if playable:
            return playable
        reason = next(iter(lacking.values()))
    raise SubstrateError(
        f"{name} plays no case of {' or '.join(tracks.defaults)}: {reason}. Give a substrate of other suites "
        "cases to be examined with: SubstrateKind(examples=...)."
    )
