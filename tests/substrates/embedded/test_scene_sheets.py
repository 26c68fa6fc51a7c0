from __future__ import annotations

from pathlib import Path

import cv2

from pytest_libero_max.substrates.embedded.scene_sheets import write_pro, write_scenes
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.tasks.libero_tasks import task
from pytest_libero_max.tasks.sources import PRO_CATEGORIES


def test_a_contact_sheet_shows_each_scene_under_its_caption(tmp_path: Path) -> None:
    path = tmp_path / "sheets" / "scenes.png"
    rows = [task("libero_spatial", 4), task("libero_object", 9), task("libero_spatial", 4)]
    write_scenes(path, rows=rows, size=96, columns=2)
    sheet = cv2.imread(str(path))
    assert sheet is not None
    # Under its key, "in the top drawer of the wooden cabinet" takes three lines; that makes room for all.
    caption, tall = 4 * 16, 4 * 16 + 96
    assert sheet.shape == (2 * tall, 2 * 96, 3)
    for row, column in ((0, 0), (0, 1), (1, 0)):
        tile = sheet[row * tall : (row + 1) * tall, column * 96 : (column + 1) * 96]
        assert tile[:caption].min() < 128  # words
        assert tile[caption:, :-1].std() > 10  # a picture
    assert (sheet[tall:, 96:] == 255).all()


def test_every_category_has_its_picture_under_its_name(tmp_path: Path) -> None:
    substrate, columns = EmbeddedSubstrate(), len(PRO_CATEGORIES) + 1
    write_pro(tmp_path / "pro.png", substrate, picks=(("libero_object", 3),), columns=columns, size=96)
    substrate.close()
    sheet = cv2.imread(str(tmp_path / "pro.png"))
    assert sheet is not None
    caption = len(sheet) - 96
    assert caption % 16 == 0
    assert sheet.shape[1] == columns * 96
    assert sheet[caption - 16 : caption].min() < 128  # no line more than the longest caption takes
    for number in range(columns):
        tile = sheet[:, number * 96 : (number + 1) * 96]
        if number < len(PRO_CATEGORIES):
            assert tile[:caption].min() < 128  # words
            assert tile[caption:, :-1].std() > 10  # a picture
        else:
            assert (tile == 255).all()
