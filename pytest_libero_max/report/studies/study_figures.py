"""Figures of a study as standalone SVG documents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from pytest_libero_max.report.formats import Estimate, percent
from pytest_libero_max.report.palette import ARMS, BOX, MUTED
from pytest_libero_max.report.plots import Drawable
from pytest_libero_max.report.render.drawing import drawn
from pytest_libero_max.report.render.svg import circle, document, line, rectangle, text
from pytest_libero_max.report.studies.study_document import Setting, Study
from pytest_libero_max.report.studies.study_section import section_of

_LEFT, _WIDTH, _HEIGHT, _ABOVE = 60.0, 480.0, 240.0, 30.0


@dataclass(frozen=True)
class Series:
    """A line of a plot."""

    name: str
    color: str
    points: Sequence[tuple[float, Estimate]]
    """Place on the x axis (0 to 1), and a rate with its interval."""


def study_plots(study: Study | None) -> dict[str, Drawable | str]:
    """Return plots and SVG documents of a study by the stem of their file name; none without cases."""
    if study is None or study.cases == 0:
        return {}
    plots: dict[str, Drawable | str] = {}
    if study.settings:
        plots[study.name] = sweep_plot(study.title, study.settings)
    section = section_of(study)
    return plots if section is None else {**plots, **section.plots(study)}


def study_figures(study: Study | None) -> dict[str, str]:
    """Return the figures of a study as SVG documents, see :func:`study_plots`."""
    plots = study_plots(study)
    return {stem: plot if isinstance(plot, str) else drawn(plot) for stem, plot in plots.items()}


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
    return axis_plot(title, axis, list(zip(places, labels, strict=True)), lines)


def axis_plot(
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
