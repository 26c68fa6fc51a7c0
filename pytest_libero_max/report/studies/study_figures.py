"""Figures of a study as standalone SVG documents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from pytest_libero_max.report.formats import Estimate, percent
from pytest_libero_max.report.palette import ARMS, BOX, MUTED
from pytest_libero_max.report.render.drawing import drawn
from pytest_libero_max.report.run_plots import camera_contrasts
from pytest_libero_max.report.studies.study_document import (
    Camera,
    Setting,
    Study,
)
from pytest_libero_max.report.writers.svg import circle, document, line, rectangle, text

_LEFT, _WIDTH, _HEIGHT, _ABOVE = 60.0, 480.0, 240.0, 30.0


@dataclass(frozen=True)
class Series:
    """A line of a plot."""

    name: str
    """Name in the legend."""
    color: str
    """Of the line and its points."""
    points: Sequence[tuple[float, Estimate]]
    """Place on the x axis (0 to 1), and a rate with its interval."""


def study_figures(study: Study | None) -> dict[str, str]:
    """Return the figures of a study by the stem of their file name; none without cases.

    Args:
        study: ``report.study``; None for a run of no study.
    """
    if study is None or study.cases == 0:
        return {}
    figures = {study.name: sweep_plot(study.title, study.settings)} if study.settings else {}
    if study.camera is not None:
        figures["study-contrasts"] = drawn(camera_contrasts(study.title, study.camera))
        if len(study.camera.approach) > 1:
            figures["study-strength"] = strength_plot(study.title, study.camera)
    return figures


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
    return _plot(
        f"{title}: success by strength", "strength of the camera change", ticks, lines, study.rates["base"]
    )


def sweep_plot(title: str, settings: Sequence[Setting]) -> str:
    """Success in Base and Dynamic at every setting, in the order of the table."""
    return success_plot(
        f"{title}: success by setting",
        "setting",
        [setting.label for setting in settings],
        [setting.base_success for setting in settings],
        [setting.dynamic_success for setting in settings],
    )


def success_plot(
    title: str, axis: str, labels: Sequence[str], base: Sequence[Estimate], dynamic: Sequence[Estimate]
) -> str:
    """Success in Base and Dynamic side by side, at each of some places with a label."""
    places = [(index + 0.5) / len(labels) for index in range(len(labels))]
    lines = [
        Series(name, color, list(zip(places, rates, strict=True)))
        for name, color, rates in (("Base", ARMS[0], base), ("Dynamic", ARMS[1], dynamic))
    ]
    return _plot(title, axis, list(zip(places, labels, strict=True)), lines)


def _plot(
    title: str,
    axis: str,
    ticks: Sequence[tuple[float, str]],
    lines: Sequence[Series],
    band: Estimate | None = None,
) -> str:
    """Rates over an axis with vertical intervals; ``band`` is a rate that is drawn across."""
    shapes: list[str] = []
    if band is not None:
        top, bottom = _up(band.upper), _up(band.lower)
        shapes += [
            rectangle(_LEFT, top, _WIDTH, max(bottom - top, 1.0), BOX),
            line(_LEFT, _up(band.value), _LEFT + _WIDTH, _up(band.value), ARMS[0], 1.5),
            text(_LEFT + _WIDTH + 22, _up(band.value) + 4, f"Base {percent(band.value)}", color=ARMS[0]),
        ]
    for tick in range(0, 101, 20):
        shapes += [
            line(_LEFT, _up(tick / 100), _LEFT + _WIDTH, _up(tick / 100)),
            text(_LEFT - 8, _up(tick / 100) + 4, f"{tick}%", "end", 11, MUTED),
        ]
    for place, words in ticks:
        for number, part in enumerate(words.split(" (")):
            shown = part if number == 0 else f"({part}"
            y = _ABOVE + _HEIGHT + 18 + 14 * number
            shapes.append(text(_across(place), y, shown, "middle", 11, MUTED))
    shapes.append(text(_LEFT + _WIDTH / 2, _ABOVE + _HEIGHT + 52, axis, "middle", 12, MUTED))
    for index, series in enumerate(lines):
        shapes += _series(series, 4.0 * index)
        shapes += [
            circle(_LEFT + 90 * index + 6, 14, 5, series.color),
            text(_LEFT + 90 * index + 16, 18, series.name),
        ]
    return document(_LEFT + _WIDTH + 120, _ABOVE + _HEIGHT + 64, title, shapes)


def _series(series: Series, aside: float) -> list[str]:
    """Points with intervals, joined; moved aside a little so that equal ones are both seen."""
    shapes: list[str] = []
    spots = [(_across(place) + aside, rate) for place, rate in series.points]
    for (x, rate), (next_x, following) in pairwise(spots):
        shapes.append(line(x, _up(rate.value), next_x, _up(following.value), series.color, 1.5))
    for x, rate in spots:
        shapes += [
            line(x, _up(rate.lower), x, _up(rate.upper), series.color, 2.5),
            circle(x, _up(rate.value), 5, series.color),
        ]
    return shapes


def _across(place: float) -> float:
    return _LEFT + _WIDTH * place


def _up(rate: float | None) -> float:
    return _ABOVE + _HEIGHT * (1 - (rate or 0.0))
