from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import pytest_libero_max
from pytest_libero_max.substrates.embedded.substrate import assets_digest

PACKAGE = Path(pytest_libero_max.__file__).parent


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    return Path(shutil.copytree(PACKAGE, tmp_path / "package"))


@pytest.mark.parametrize(
    ("old", "new", "counts"),
    [
        ('"""', '"""Other words. ', False),
        ("\n\n", "\n\n# A comment.\n", False),
        ("SCENES = 12", "SCENES = 13", True),
    ],
)
def test_the_assets_outlive_a_docstring_but_not_a_number(
    copied: Path, old: str, new: str, counts: bool
) -> None:
    before = assets_digest(copied)
    file = copied / "substrates" / "embedded" / "substrate.py"
    file.write_text(file.read_text().replace(old, new, 1))
    assert (assets_digest(copied) != before) == counts


def test_every_scene_and_the_rotations_count(copied: Path) -> None:
    before = assets_digest(copied)
    for name in ("worlds/rotations.py", "substrates/embedded/objects/mugs.py"):
        with (copied / name).open("a") as file:
            file.write("\n_SIZE_M = 0.1\n")
        after = assets_digest(copied)
        assert after != before
        before = after
