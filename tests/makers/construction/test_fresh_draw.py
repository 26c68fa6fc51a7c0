"""Fresh draws: bound before they are made, in new scenes, and chosen again by whoever has the seed."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.identity import Draw, Identity
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.tracks import FOLDER, load_track, track_names
from pytest_libero_max.errors import ManifestError, OptionError
from pytest_libero_max.events.configurations import cell_of
from pytest_libero_max.makers.construction.fresh_draw import (
    COMMITMENT,
    SEED,
    Frozen,
    bind,
    frozen_beside,
    read_draw,
    scene_of,
    select_fresh,
)
from pytest_libero_max.makers.construction.verification import verify

NAME = "2026Q4"
DRAW = Draw("2027Q1", "a seed")


@pytest.fixture(scope="module")
def frozen() -> Frozen:
    """A small old track, an obstacle among it, beside all scenes of the frozen tracks."""
    whole = frozen_beside(FOLDER / DRAW.name, "lite", DRAW.name)
    some = whole.old.cases[::40]
    assert len({case.event.name for case in some}) == 8
    return whole._replace(old=Manifest("old", "1", whole.old.protocol, some))


def test_the_frozen_draw_is_right_and_new() -> None:
    lines = verify(FOLDER / NAME)
    assert lines[0].startswith(f"{NAME}: ")
    assert COMMITMENT in lines[0]
    assert lines[1].startswith("lite: 800 cases")
    old, new = load_track("lite"), load_track(f"{NAME}/lite")
    assert [cell_of(case) for case in new] == [cell_of(case) for case in old]
    known = {scene_of(case) for name in track_names() for case in load_track(name)}
    assert not known & {scene_of(case) for case in new}
    assert not {case.event.seed for case in old} & {case.event.seed for case in new}
    assert {case.policy_seed for case in new} == {read_draw(FOLDER / NAME).policy_seed}


def test_a_draw_has_seeds_of_its_own() -> None:
    plain = Identity("pro", "libero_10", 0, 1, "camera_view_angle")
    drawn = [
        Identity("pro", "libero_10", 0, 1, "camera_view_angle", draw)
        for draw in (DRAW, Draw("2027Q1", "another"), Draw("2027Q2", "a seed"))
    ]
    assert len({one.seed("camera_shift", 0) for one in (plain, *drawn)}) == 4
    assert len({one.case_id("camera_shift", 0) for one in (plain, *drawn)}) == 4
    assert drawn[0].sampler == "libero-max-pro-hard-v1.0/2027Q1"


def test_cases_that_fail_are_replaced_and_never_examined_again(frozen: Frozen) -> None:
    examined: list[str] = []

    def some_fail(cases: Sequence[Case]) -> list[str]:
        examined.extend(case.case_id for case in cases)
        return [case.case_id for case in cases if case.event.seed % 3 == 0]

    fresh = select_fresh(some_fail, frozen, DRAW)
    assert len(examined) == len(set(examined)) > len(fresh)
    assert [cell_of(case) for case in fresh] == [cell_of(case) for case in frozen.old]
    assert len({scene_of(case) for case in fresh}) == len(fresh)
    failed = set(examined) - {case.case_id for case in fresh}
    assert (
        select_fresh(lambda cases: [c.case_id for c in cases if c.case_id in failed], frozen, DRAW) == fresh
    )
    other = select_fresh(lambda _: [], frozen, Draw(DRAW.name, "another seed"))
    assert Counter(map(cell_of, other)) == Counter(map(cell_of, fresh))
    assert {scene_of(case) for case in other} != {scene_of(case) for case in fresh}


def test_an_obstacle_that_was_rejected_in_a_scene_is_not_examined_there_again(frozen: Frozen) -> None:
    obstacle = next(case for case in frozen.old if case.event.name == "obstacle_insertion")
    alone = frozen._replace(old=Manifest("old", "1", frozen.old.protocol, (obstacle,)), rejected=())
    (first,) = select_fresh(lambda _: [], alone, DRAW)
    known = first.case_id.replace(f"-p{DRAW.policy_seed}", "-p195")
    (second,) = select_fresh(lambda _: [], alone._replace(rejected={known}), DRAW)
    assert scene_of(second) != scene_of(first)


def test_a_cell_without_a_scene_left_is_named(frozen: Frozen) -> None:
    with pytest.raises(ManifestError, match=r"in its cell \(.*variant [01]\)"):
        select_fresh(lambda cases: [case.case_id for case in cases], frozen, DRAW)


def test_a_seed_is_bound_once(tmp_path: Path) -> None:
    folder, secret = tmp_path / NAME, tmp_path / "secret"
    digest = bind(folder, NAME, secret)
    assert (folder / COMMITMENT).read_text() == f"{digest}  {SEED}\n"
    assert not (folder / SEED).exists()
    draw = read_draw(folder, secret)
    assert draw.name == NAME
    assert len(draw.seed) == 64
    with pytest.raises(OptionError, match="has a seed already"):
        bind(folder, NAME, secret)
    with pytest.raises(OptionError, match=r"draw='a/b'"):
        bind(tmp_path / "other", "a/b", tmp_path / "other-secret")


def test_another_seed_than_the_published_one_is_found(tmp_path: Path) -> None:
    folder = shutil.copytree(FOLDER, tmp_path / "tracks") / NAME
    (folder / SEED).write_text(f"{NAME} {'0' * 64}\n")
    with pytest.raises(ManifestError, match="not the seed"):
        verify(folder)
    (folder / SEED).unlink()
    with pytest.raises(ManifestError, match=r"needs its seed"):
        verify(folder)


def test_a_draw_before_one_that_was_made_is_refused() -> None:
    with pytest.raises(OptionError, match="a later name"):
        frozen_beside(FOLDER / "2026Q1", "lite", "2026Q1")
