from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from tests.scripts import versions
from tests.scripts.measure import blind, make_case


def episode(*steps: float, success: bool = True) -> dict[str, object]:
    return {"s/0/0/path": np.array([[0.0, step] for step in steps]), "s/0/0/success": np.array(success)}


def test_paths_are_compared_as_far_as_both_go() -> None:
    one, other = np.zeros((4, 2)), np.zeros((6, 2))
    assert versions.first_beyond(one, other, 0.0) is None
    other[2, 1] = 1e-4
    other[5, 0] = 1.0
    assert versions.first_beyond(one, other, 0.0) == 3
    assert versions.first_beyond(one, other, 1e-3) is None


def test_what_differs_is_said_in_all_and_by_scene() -> None:
    black, grey = (np.full((2, 2, 3), level, dtype=np.uint8) for level in (0, 7))
    first = episode(0.0, 0.1, 0.2) | {"s/0/agentview_image": black}
    second = episode(0.0, 0.1, 0.3, 0.4, success=False) | {"s/0/agentview_image": grey}
    assert list(versions.compare({"here": first, "same": first, "there": second}))[1:] == [
        "| here | 1/1 | | | | | | |",
        "| same | 1/1 | 0 | 0 | 0 | 0 | 0 | 0/1 |",
        "| there | 0/1 | 1 | 1, by at most 1 | 1, 3 | 1, 3 | 1, 3 | 1/1, 100.00% of pixels, by at most 7 |",
        "s/0: there from state 0",
    ]


def test_where_a_scene_parts_is_said_with_the_largest_difference() -> None:
    first, other = episode(0.0, 0.1, 0.2), episode(0.0, 0.1002, 0.205, 9.0)
    lines = ["| Scene | same | other |", "|---|---|---|", "| s/0 | equal | 2, 0.005 |"]
    assert list(versions.divergences(first, {"same": first, "other": other}, 1e-4)) == lines
    assert list(versions.divergences(first, {"other": other}, 1e-3))[2:] == ["| s/0 | 3, 0.005 |"]


@pytest.mark.parametrize("first", [1, 2, 3, 4, 5, 6, None])
def test_the_release_that_moved_a_scene_is_bisected(
    first: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    played: list[str] = []

    def run(options: object, release: str, file: Path, *scene: object) -> None:
        moved = first is not None and int(release) >= first
        if not file.exists():
            played.append(release)
        np.savez(file, **{"s/0/0/path": np.array([[0.0], [0.5 if moved else 0.0]])})

    monkeypatch.setattr(versions, "run_release", run)
    options = argparse.Namespace(
        folder=tmp_path, releases=[*"0123456"], bound=1e-3, suites=["s"], tasks=[0], inits=1
    )
    expected = "none" if first is None else f"{first} | 2, 0.5"
    assert list(versions.bisect(options)) == [f"| s/0 | {expected} |"]
    assert len(played) == (2 if first is None else len({*played})) <= 5
    before = len(played)
    assert list(versions.bisect(options)) == [f"| s/0 | {expected} |"]
    assert len(played) == before


def test_a_file_is_gone_on_with_by_the_same_versions_alone(tmp_path: Path) -> None:
    file = tmp_path / "here.npz"
    kept = versions.begun(file, "MuJoCo 3.3.7, expert")
    np.savez_compressed(file, **kept, **{"s/0/0/success": np.array(True)})
    assert bool(versions.begun(file, "MuJoCo 3.3.7, expert")["s/0/0/success"])
    with pytest.raises(SystemExit, match=r"3\.3\.7, expert.* 3\.4\.0, expert"):
        versions.begun(file, "MuJoCo 3.4.0, expert")


def test_recorded_actions_are_executed_until_they_end() -> None:
    case, policy = make_case("libero_spatial", 0, 0), blind("expert")
    substrate = EmbeddedSubstrate()
    played = versions.trajectory(case, substrate.world(case), policy)
    again = versions.trajectory(case, substrate.world(case), policy, played.actions)
    part = versions.trajectory(case, substrate.world(case), policy, played.actions[:5])
    substrate.close()
    assert (played.success, again.success, part.success) == (True, True, False)
    assert np.array_equal(again.path, played.path)
    assert np.array_equal(part.path, played.path[:5])
