"""Tracks of unmodified tasks: balance, replacement, determinism, and what a benchmark is called."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.suites import SUITES, Suite
from pytest_libero_max.errors import ManifestError, OptionError
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.makers.construction import unmodified_tracks
from pytest_libero_max.makers.construction.unmodified_tracks import (
    Population,
    hosting_lines,
    require_drawn,
    select,
)
from pytest_libero_max.substrates.contract import Substrate, SubstrateKind, SubstrateOptions, Tracks
from pytest_libero_max.substrates.registry import SUBSTRATES
from pytest_libero_max.tasks.contents import InitialPlacement, Relation, Room, TaskMetadata

TASKS, STATES = 6, 8
SUITE = Suite("shapes_six", 90, "shapes", "six", tasks=TASKS, states=STATES)
FIXED = "its receptacle is a hole."


def _contents(suite: str, index: int) -> TaskMetadata:
    """Tasks of which only the first two can host a move of the receptacle."""
    names = ("cube", "plate", *(f"spare_{number}" for number in range(1, 6)))
    return TaskMetadata(
        name=f"task-{index}",
        language="put the cube on the plate",
        objects=dict.fromkeys(names, "thing"),
        fixtures={"table": "table"},
        objects_of_interest=frozenset(("cube", "plate")),
        goal=(Relation("On", ("cube", "plate")),),
        placements=dict.fromkeys(names, InitialPlacement("On", "table", "table")),
        camera="overview",
        other_cameras=("palm",),
        part="lid",
        trigger_distance_m=0.1,
        rooms={"cube": Room((0.0, 0.0), (0.3, 0.1))},
        impossible={} if index < 2 else {"receptacle_relocation": FIXED},
    )


def _open(options: SubstrateOptions) -> Substrate:
    raise NotImplementedError


KIND = SubstrateKind(
    "shapes",
    _open,
    suites=(SUITE.name,),
    contents=_contents,
    tracks=lambda options: Tracks("shapes", per_event={"smoke": 3, "all": 10}),
)


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    # A registry holds what is installed, and nobody adds to it in other ways.
    monkeypatch.setattr(SUITES, "_loaders", {**SUITES._known(), SUITE.name: lambda: SUITE})
    monkeypatch.setattr(SUBSTRATES, "_loaders", {**SUBSTRATES._known(), KIND.name: lambda: KIND})


@pytest.fixture
def population() -> Population:
    return Population(KIND, SubstrateOptions())


def _nothing_fails(cases: Sequence[Case]) -> list[str]:
    return []


def test_a_track_has_equally_many_cases_of_each_event_and_spreads_them_over_tasks(
    population: Population,
) -> None:
    track = select(_nothing_fails, population, "all")
    assert Counter(case.event.name for case in track) == dict.fromkeys(BENCHMARK_EVENTS, 10)
    variants = Counter((case.event.name, case.event.variant) for case in track)
    assert set(variants.values()) == {5}
    tasks = Counter(case.task_index for case in track)
    assert len(tasks) == TASKS
    assert max(tasks.values()) - min(tasks.values()) <= 1
    moved = {case.task_index for case in track if case.event.name == "receptacle_relocation"}
    assert moved == {0, 1}


def test_variants_take_turns_from_one_event_to_the_next(population: Population) -> None:
    track = select(_nothing_fails, population, "smoke")
    assert len(track) == 24
    assert Counter(case.event.variant for case in track) == {0: 12, 1: 12}


def test_a_case_that_fails_is_replaced_in_its_cell_and_the_others_stay(population: Population) -> None:
    before = select(_nothing_fails, population, "all")
    bad = {case.case_id for case in before.cases[::7]}
    examined: list[str] = []

    def examine(cases: Sequence[Case]) -> list[str]:
        examined.extend(case.case_id for case in cases)
        return [case.case_id for case in cases if case.case_id in bad]

    after = select(examine, population, "all")
    assert not bad & {case.case_id for case in after}
    assert {case.case_id for case in before} - bad <= {case.case_id for case in after}
    cells = [Counter((case.event.name, case.event.variant) for case in track) for track in (before, after)]
    assert cells[0] == cells[1]
    assert len(examined) == len(set(examined))


def test_a_cell_without_enough_cases_is_smaller(population: Population) -> None:
    def only_one_receptacle(cases: Sequence[Case]) -> list[str]:
        return [
            case.case_id
            for case in cases
            if case.event.name == "receptacle_relocation"
            and (case.task_index, case.init_state_index) != (0, 0)
        ]

    track = select(only_one_receptacle, population, "all")
    moves = [case for case in track if case.event.name == "receptacle_relocation"]
    assert sorted(case.event.variant for case in moves) == [0, 1]
    with pytest.raises(ManifestError, match="no case"):
        select(lambda cases: [case.case_id for case in cases], population, "smoke")


def test_the_same_answers_lead_to_the_same_bytes(population: Population) -> None:
    first, second = (select(_nothing_fails, population, "all").to_json() for _ in range(2))
    assert first == second
    assert list(require_drawn("all", select(_nothing_fails, population, "all")))


def test_a_case_that_somebody_edited_is_found(population: Population) -> None:
    track = select(_nothing_fails, population, "smoke")
    edited = replace(track.cases[0], record={**track.cases[0].record, "policy_seed": 7})
    altered = Manifest(track.benchmark_id, track.version, track.protocol, (edited, *track.cases[1:]))
    with pytest.raises(ManifestError, match=edited.case_id):
        list(require_drawn("smoke", altered))


def test_an_unmodified_task_names_its_own_benchmark() -> None:
    case = make_case("target_relocation", SUITE.name, 3, 5, variant=1)
    assert (case.source, case.source_category, case.unmodified) == ("shapes", "Unmodified", True)
    assert case.case_id == "shapes-six-t03-i05-target_relocation-d1-p195"
    assert case.item_id == "shapes-six-t03-i05-target_relocation-v1"
    scenario = case.record["scenario"]
    assert scenario["base_task_id"] == "shapes/shapes_six/task_3"
    assert scenario["randomization"]["sampler"] == "libero-max-shapes-v1.0"


def test_the_trigger_and_the_direction_follow_from_the_contents_of_the_task() -> None:
    case = make_case("target_relocation", SUITE.name, 0)
    assert case.event.trigger == {"type": "on_proximity", "value": "lid", "distance_m": 0.1}
    assert case.event.change["object"] == "cube"
    assert case.event.change["direction_xy"][1] == 0.0, "across its room, which is 30 x 10 cm"
    assert make_case("camera_shift", SUITE.name, 0).event.change["camera"] == "overview"


def test_an_event_that_a_task_cannot_host_says_why(population: Population) -> None:
    with pytest.raises(ManifestError, match=FIXED):
        make_case("receptacle_relocation", SUITE.name, 4)
    assert f"    4 cannot: {FIXED}" in hosting_lines(population)


def test_a_track_that_is_not_declared_is_refused(population: Population) -> None:
    with pytest.raises(OptionError, match="smoke"):
        select(_nothing_fails, population, "smok")
    with pytest.raises(OptionError, match="embedded"):
        unmodified_tracks.Population(SUBSTRATES["embedded"], SubstrateOptions())


def test_a_room_says_which_share_of_its_places_stays_inside() -> None:
    room = Room((0.0, 0.0), (0.2, 0.1))
    assert room.share(0.05, 0.0) == pytest.approx(0.75)
    assert room.share(0.1, -0.05) == pytest.approx(0.25)
    assert room.share(0.0, 0.12) == 0.0
    line = Room((0.0, 0.5), (0.2, 0.5))
    assert line.share(0.1, 0.0) == pytest.approx(0.5)
    assert line.share(0.0, 0.01) == 0.0
    assert [room.holds(x, 0.0) for x in (0.2, 0.21)] == [True, False]


@pytest.mark.parametrize("values", [{"benchmark": "plus"}, {"tasks": 0}, {"states": -1}])
def test_a_suite_refuses_values_that_make_no_sense(values: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(values))):
        replace(SUITE, **values)  # type: ignore[arg-type]
