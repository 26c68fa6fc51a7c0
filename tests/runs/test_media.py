from __future__ import annotations

from pathlib import Path

from pytest_libero_max.runs.media import (
    caption_of,
    distinct_arms,
    film_name,
    filmed_arms,
    films_in,
    kept_beside,
    pictures_in,
)
from tests.report.made_up import plan, record_of


def test_the_films_of_a_run_are_found_by_their_pairs(tmp_path: Path) -> None:
    folder = tmp_path / "films"
    folder.mkdir()
    names = [film_name("a-t00", ("base", "dynamic"), ".mp4"), film_name("b--c", ("base",), ".webp")]
    for name in (*names, "notes.txt", ".a--base.mp4.7.partial", ".a--base.mp4", "a--base.gif"):
        (folder / name).touch()
    assert names == ["a-t00--base-dynamic.mp4", "b--c--base.webp"]
    assert films_in(tmp_path) == {"a-t00": f"films/{names[0]}", "b--c": f"films/{names[1]}"}
    assert films_in(tmp_path / "nothing") == {}


def test_a_film_of_many_arms_has_a_name_that_a_file_system_takes(tmp_path: Path) -> None:
    arms = [f"dynamic_controller_{number}" for number in range(20)]
    name = film_name("a" * 100, arms, ".mp4", "policy")
    assert len(name) < 255
    assert "20_arms" in name
    (tmp_path / "films").mkdir()
    (tmp_path / "films" / name).touch()
    assert films_in(tmp_path, "policy") == {"a" * 100: f"films/{name}"}


def test_a_film_of_what_a_policy_saw_is_kept_but_not_taken_for_the_film_of_the_pair(tmp_path: Path) -> None:
    folder = tmp_path / "films"
    folder.mkdir()
    name = film_name("a-t00", ("base", "dynamic"), ".webp", "policy")
    assert name == "a-t00--base-dynamic--policy.webp"
    (folder / name).touch()
    assert films_in(tmp_path) == {}
    assert films_in(tmp_path, "policy") == {"a-t00": f"films/{name}"}
    assert caption_of(f"films/{name}", "a-t00") == "base-dynamic, what the policy saw"
    assert kept_beside(tmp_path) == ["films"]


def test_the_pictures_of_a_case_are_found_before_first(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    for name in (
        "a--wrist-after.png",
        "a--wrist-before.png",
        "a--agent-after.png",
        "b--agent-before.png",
        "c.png",
    ):
        (tmp_path / "pictures" / name).touch()
    assert pictures_in(tmp_path) == {
        "a": ["pictures/a--agent-after.png", "pictures/a--wrist-before.png", "pictures/a--wrist-after.png"],
        "b": ["pictures/b--agent-before.png"],
    }


def test_the_arms_of_a_film_of_many_are_those_of_the_pair() -> None:
    record = record_of(plan()[0], True, True)
    names = film_name(record.item_id, ("base", "dynamic"), ".mp4")
    assert filmed_arms(f"films/{names}", record) == ("base", "dynamic")
    many = film_name(record.item_id, ["arm"] * 99, ".mp4")
    assert filmed_arms(f"films/{many}", record) == distinct_arms(record)
