"""Tracks of unmodified tasks: chosen from any benchmark whose substrate says what its tasks contain.

A track has equally many cases of each event, its variants by turns. Each case is the first configuration, a
task with an initial state, in this order: the task that the cell (event and variant) has used least, the task
that the track has used least, the initial state used least, then a hash. Cells that few tasks can host are
filled first, so that the others make up for it. A case that fails the preflight is replaced in its own cell
and counts as a use of its task there; one that has passed keeps its place. Where too few tasks can host an
event, its cells have fewer cases.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.identity import Identity, seed_of
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.errors import ManifestError, OptionError, did_you_mean
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, EVENTS, eligible
from pytest_libero_max.makers.construction.case_selection import Examine, choose
from pytest_libero_max.makers.construction.release import ExamineCases, Examined, Release
from pytest_libero_max.makers.construction.splits import protocol
from pytest_libero_max.substrates.contract import SubstrateKind, SubstrateOptions
from pytest_libero_max.tasks.contents import TaskMetadata

VERSION = "1.0.0"

Task = tuple[str, int]
"""Suite and index."""


class Cell(NamedTuple):
    """An event in one of its variants."""

    event: str
    variant: int


class Place(NamedTuple):
    """A configuration in a cell."""

    cell: Cell
    task: Task
    state: int


class Population:
    """Tasks of a substrate, and the events that each can host.

    Raises:
        OptionError: The substrate declares no track to be drawn from its tasks.
    """

    def __init__(self, kind: SubstrateKind, options: SubstrateOptions) -> None:
        self.name, self.suites = kind.name, kind.suites or ()
        self.per_event = kind.tracks(options).per_event
        self._contents = kind.contents
        if not self.per_event:
            raise OptionError.seen("substrate", kind.name, " has no tracks of unmodified tasks.")

    @cached_property
    def tasks(self) -> Mapping[Task, TaskMetadata]:
        return {
            (suite, index): self._contents(suite, index)
            for suite in self.suites
            for index in range(SUITES[suite].tasks)
        }

    @cached_property
    def hosts(self) -> Mapping[str, tuple[Task, ...]]:
        return {
            event: tuple(task for task, contents in self.tasks.items() if eligible(event, contents))
            for event in BENCHMARK_EVENTS
        }

    def case_id(self, place: Place) -> str:
        return Identity.unmodified(*place.task, place.state).case_id(*place.cell)

    def case(self, place: Place) -> Case:
        return make_case(place.cell.event, *place.task, place.state, variant=place.cell.variant)

    def cells(self, per_event: int) -> Mapping[Cell, int]:
        """Return the cells of a track with the number of cases of each; the scarcest come first."""
        needed = Counter(
            Cell(event, (number + place) % 2)
            for place, event in enumerate(BENCHMARK_EVENTS)
            for number in range(per_event)
        )
        return dict(sorted(needed.items(), key=lambda item: (len(self.hosts[item[0].event]), item[0])))


def build_unmodified(examine: ExamineCases, population: Population, names: Iterable[str]) -> Release:
    """Choose the cases of some tracks that the substrate declares.

    Raises:
        OptionError: There is no such track.
        ManifestError: No case passes.
    """
    examined = Examined(examine)
    release = examined.release({name: select(examined.failing, population, name) for name in names})
    return replace(release, cameras=next(iter(population.tasks.values())).cameras)


def select(examine: Examine, population: Population, track: str) -> Manifest:
    """Choose the cases of a track that the substrate declares.

    Raises:
        OptionError: The substrate declares no such track.
        ManifestError: No case passes.
    """
    if track not in population.per_event:
        known = did_you_mean(track, population.per_event)
        raise OptionError.seen("track", track, f" cannot be built. {known}")
    places: list[Place] = []

    def fill_cells(passed: Collection[str], failed: Collection[str]) -> dict[str, Place]:
        nonlocal places
        kept = [place for place in places if population.case_id(place) in passed]
        places = propose(population, track, kept, failed)
        return {population.case_id(place): place for place in places}

    return _manifest(population, track, choose(examine, fill_cells, population.case))


def propose(
    population: Population, track: str, kept: Sequence[Place], failed: Collection[str]
) -> list[Place]:
    """Fill the cells of a track around what is kept, without the ids that failed."""
    used, states = (
        Counter(place.task for place in kept),
        Counter((*place.task, place.state) for place in kept),
    )
    places = [*kept]
    for cell, needed in population.cells(population.per_event[track]).items():
        here = [place for place in kept if place.cell == cell]
        used_here = Counter(place.task for place in here)
        free, rejected = _by_task(population, cell, {*here}, failed)
        used_here.update(rejected)  # or a task that can hardly host an event would be tried again and again
        for _ in range(needed - len(here)):
            if not free:
                break
            task = min(free, key=lambda task: (used_here[task], used[task], seed_of(track, *cell, *task)))
            best = min(free[task], key=lambda place: (states[(*task, place.state)], _rank(track, place)))
            free[task].remove(best)
            if not free[task]:
                del free[task]
            used.update([task])
            used_here.update([task])
            states.update([(*task, best.state)])
            places.append(best)
    return places


def _by_task(
    population: Population, cell: Cell, taken: Collection[Place], failed: Collection[str]
) -> tuple[dict[Task, list[Place]], Counter[Task]]:
    """Return the configurations that may still be used in a cell, and how many were rejected, by task."""
    free: dict[Task, list[Place]] = {}
    rejected: Counter[Task] = Counter()
    for task in population.hosts[cell.event]:
        for state in range(SUITES[task[0]].states):
            place = Place(cell, task, state)
            if population.case_id(place) in failed:
                rejected[task] += 1
            elif place not in taken:
                free.setdefault(task, []).append(place)
    return free, rejected


def _rank(track: str, place: Place) -> int:
    return seed_of(track, *place.cell, *place.task, place.state)


def _manifest(population: Population, track: str, cases: tuple[Case, ...]) -> Manifest:
    if not cases:
        raise ManifestError(f"{track}: no case of any task passes the preflight.")
    contract = (
        f"{population.per_event[track]} cases of each event, its variants by turns; scarcest event first, "
        "least used task of the cell, what was rejected in it counting as used, least used task, least used "
        "initial state, then SHA-256 rank; physical preflight with replacement in the cell; independent of "
        "policy outcomes"
    )
    (benchmark,) = {SUITES[suite].benchmark for suite in population.suites}
    named = f"libero-max-{population.name}-{track}"
    return Manifest(named, VERSION, protocol(track, contract, benchmark), cases)


def hosting_lines(population: Population) -> list[str]:
    """Return lines on the tasks that can host each event, and on why the others cannot."""
    lines = [f"{len(population.tasks)} tasks of {population.name}"]
    for event, hosts in population.hosts.items():
        lines += ["", f"{event}: {len(hosts)} tasks"]
        others = [contents for task, contents in population.tasks.items() if task not in hosts]
        reasons = Counter(_reason(event, contents) for contents in others)
        lines += [f"  {count:>3} cannot: {reason}" for reason, count in reasons.most_common()]
    return lines


def _reason(event: str, contents: TaskMetadata) -> str:
    return contents.impossible.get(event, f"it needs {EVENTS[event].needs}")


def require_drawn(name: str, manifest: Manifest) -> Iterator[str]:
    """Yield checks of a track: every case is the one that its identity demands, events have equally many."""
    for case in manifest:
        made = make_case(
            case.event.name, case.suite, case.task_index, case.init_state_index, variant=case.event.variant
        )
        if made.record != case.record:
            raise ManifestError(f"{name}: {case.case_id!r} differs from the case that its identity demands.")
    yield f"{name}: {len(manifest)} cases, each as its identity demands, digest {manifest.digest}"
    events = Counter(case.event.name for case in manifest)
    tasks = Counter((case.suite, case.task_index) for case in manifest)
    spread = f"{min(tasks.values())} to {max(tasks.values())} of each of {len(tasks)} tasks"
    sizes = f"{min(events.values())} to {max(events.values())} cases of each of {len(events)} events"
    yield f"{name}: {sizes}, {spread}"
