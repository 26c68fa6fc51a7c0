"""Arms without a part of the report of their own: success and contrasts by event."""

from __future__ import annotations

import pytest

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.studies.study_document import Study
from pytest_libero_max.report.studies.study_tables import study_tables
from tests.report.studies.studied import Cell, study_of

CELLS = (
    Cell("plus", {"base": True, "reset": True, "dynamic": True}, 5),
    Cell("plus", {"base": True, "reset": True, "dynamic": False}, 6),
    Cell("pro", {"base": True, "reset": False, "dynamic": False}, 2),
    Cell("pro", {"base": False, "reset": True, "dynamic": False}, 1),
)


@pytest.fixture(scope="module")
def study() -> Study:
    planned, records, provenance = study_of(CELLS, {"name": "event-timing"})
    found = build_report(records, [], planned, provenance).study
    assert found is not None
    return found


def test_the_contrasts_part_the_changed_scene_from_the_change_in_the_middle(study: Study) -> None:
    assert study.contrasts is not None
    found = {
        (row.first, row.second, row.event): (row.cases, row.gains, row.losses) for row in study.contrasts
    }
    assert found == {
        ("reset", "base", None): (14, 1, 2),
        ("reset", "base", "camera_shift"): (14, 1, 2),
        ("dynamic", "reset", None): (14, 0, 7),
        ("dynamic", "reset", "camera_shift"): (14, 0, 7),
    }
    (middle,) = (row for row in study.contrasts if row.first == "dynamic" and row.event is None)
    assert middle.value == -0.5
    assert middle.lower is not None
    assert middle.upper is not None
    assert middle.lower < -0.5 < middle.upper < 0


def test_the_tables_have_a_row_for_each_event(study: Study) -> None:
    success, by_event, contrasts = study_tables(study)
    assert [row[0] for row in success.texts()] == ["base", "dynamic", "reset"]
    assert by_event.texts() == [["camera_shift", "13/14", "5/14", "12/14"]]
    assert [row[0] for row in contrasts.texts()] == ["all", "camera_shift"]
    assert contrasts.head == ("Event", "reset - base", "dynamic - reset")
    assert contrasts.texts()[0][2].startswith("-50.0 pp [")
