"""What the comparison of genuine images keeps in its file and says in its tables."""

from __future__ import annotations

from pathlib import Path

from tests.scripts.measure_images import AFTER, BEFORE, Drawn, cases_of, read, tables


def test_the_tables_count_what_differs_and_a_torn_line_is_not_read(tmp_path: Path) -> None:
    looks = ((BEFORE, "agentview", 0), (AFTER, "agentview", 3), (AFTER, "frontview", 0))
    rows = [
        Drawn("libero_10/2", "mirror", "camera_shift", when, camera, 80.0, 40.0, unequal)
        for when, camera, unequal in looks
    ]
    path = tmp_path / "images.tsv"
    assert read(path) == []
    path.write_text("".join("\t".join(map(str, row)) + "\n" for row in rows) + "libero_10/3\tmirr")
    assert read(path) == rows
    lines = list(tables(read(path)))
    assert "| camera_shift, after | 1 | 0 of 1 | 0 of 0 | 1 of 1 |" in lines
    assert "| all | mirror | agentview | 80.0 | 40.0 | 2.00 |" in lines
    assert lines[-1] == "3 images, 1 unequal"


def test_a_scene_plays_what_it_can_host_in_both_variants_over_the_tasks() -> None:
    events = ("camera_shift", "receptacle_relocation")
    assert [case.event.name for case in cases_of("libero_goal", 0, events)] == ["camera_shift"]
    found = {case.event.variant for task in (0, 1) for case in cases_of("libero_goal", task, events[:1])}
    assert found == {0, 1}
