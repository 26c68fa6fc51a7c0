"""The part of a report about a camera study: its results, tables, notes and plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from pytest_libero_max.errors import ReportError
from pytest_libero_max.lab.studies.camera.arms import CameraStudy
from pytest_libero_max.lab.studies.camera.blocks import Camera, ConditionContrast
from pytest_libero_max.lab.studies.camera.results import camera_results, camera_tables
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.document import Table
from pytest_libero_max.report.formats import interval_text, points
from pytest_libero_max.report.palette import ARMS
from pytest_libero_max.report.plots import Drawable, Plot, change_plot, change_row
from pytest_libero_max.report.studies.study_document import Study as StudyResults
from pytest_libero_max.report.studies.study_figures import Series, axis_plot
from pytest_libero_max.report.studies.study_section import StudySection
from pytest_libero_max.studies.study import Study

_ENOUGH = 30
"""With fewer cases, a percentile interval is too narrow."""


class CameraSection(StudySection):
    """Rates, joint outcomes, contrasts and approach of Base, Reset and Mid-task."""

    def results(self, study: Study, records: Sequence[PairRecord], tasks: Sequence[str]) -> Camera:
        assert isinstance(study, CameraStudy)
        return camera_results(study.strengths, records, tasks)

    def tables(self, study: StudyResults) -> Sequence[Table]:
        return camera_tables(_camera(study))

    def notes(self, study: StudyResults) -> Sequence[str]:
        notes = [
            "The first crossing of the trigger's distance was computed again from the trajectories of Base "
            "and Mid-task, and the camera after Reset compared with the one after Mid-task: a pair in which "
            "the crossing is not the logged one, or the cameras differ, is invalid."
        ]
        if study.cases < _ENOUGH:
            notes.append(
                f"With fewer than {_ENOUGH} cases the intervals that resample cases are too narrow. Read the "
                "exact ones."
            )
        return notes

    def plots(self, study: StudyResults) -> Mapping[str, Drawable | str]:
        camera = _camera(study)
        plots: dict[str, Drawable | str] = {"study-contrasts": camera_contrasts(study.title, camera)}
        if len(camera.approach) > 1:
            plots["study-strength"] = strength_plot(study.title, camera)
        return plots


def _camera(study: StudyResults) -> Camera:
    """Return the results, computed now or as a file has them."""
    if isinstance(study.camera, Camera):
        return study.camera
    try:
        return msgspec.convert(study.camera, Camera)
    except msgspec.ValidationError as error:
        raise ReportError(
            f"The results of the study {study.name} are damaged: {error}. Compute the report again from its "
            "pairs.jsonl."
        ) from error


def camera_contrasts(title: str, study: Camera) -> Plot:
    """Return the contrasts of a camera study with their intervals, and numbers of gains and losses."""
    labels = study.conditions
    rows = [
        change_row(
            f"{labels[row.first]} - {labels[row.second]}", f"+{row.gains} -{row.losses}", row, _change(row)
        )
        for row in study.contrasts
    ]
    return change_plot(f"{title}: paired contrasts", "Contrast (gain, loss)", rows)


def _change(row: ConditionContrast) -> str:
    return "n/a" if row.value is None else f"{points(row.value)} {interval_text(row, signed=True)}"


def strength_plot(title: str, study: Camera) -> str:
    """Success of Reset and Mid-task by strength, with the rate of Base and its interval behind them."""
    strengths = list(study.approach)
    names = [name for name in study.conditions if name != "base"]
    lines = [
        Series(
            label,
            color,
            [
                (float(strength), study.rates[arm])
                for strength, arm in zip(strengths, names[offset::2], strict=True)
            ],
        )
        for label, color, offset in (("Reset", ARMS[2], 0), ("Mid-task", ARMS[1], 1))
    ]
    ticks = [(float(strength), f"{float(strength):.0%}") for strength in strengths]
    return axis_plot(
        f"{title}: success by strength", "strength of the camera change", ticks, lines, study.rates["base"]
    )
