from __future__ import annotations

from pathlib import Path

import cv2

from pytest_libero_max.substrates.embedded.sheets import write_contact_sheet
from pytest_libero_max.tasks.libero_tasks import task


def test_a_contact_sheet_shows_each_scene_under_its_caption(tmp_path: Path) -> None:
    path = tmp_path / "sheets" / "scenes.png"
    rows = [task("libero_spatial", 4), task("libero_object", 9), task("libero_object", 0)]
    write_contact_sheet(path, rows=rows, size=96, columns=2)
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
