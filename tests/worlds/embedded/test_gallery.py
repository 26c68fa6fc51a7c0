from __future__ import annotations

import cv2

from pytest_libero_max.worlds.embedded.gallery import write_contact_sheet
from pytest_libero_max.worlds.embedded.tasks import task


def test_a_contact_sheet_shows_each_scene_under_its_caption(tmp_path):
    path = tmp_path / "sheets" / "scenes.png"
    rows = [task("libero_spatial", 4), task("libero_object", 9), task("libero_object", 0)]
    write_contact_sheet(path, rows=rows, size=64, columns=2)
    sheet = cv2.imread(str(path))
    assert sheet.shape == (2 * (64 + 32), 2 * 64, 3)
    for row, column in ((0, 0), (0, 1), (1, 0)):
        tile = sheet[row * 96 : (row + 1) * 96, column * 64 : (column + 1) * 64]
        assert tile[:32].min() < 128  # words
        assert tile[32:, :-1].std() > 10  # a picture
    assert (sheet[96:, 64:] == 255).all()
