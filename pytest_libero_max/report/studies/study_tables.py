"""A study as tables and sentences, which every writer of a report prints in its own way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any, ClassVar

from pytest_libero_max.report.document import Table, table_of
from pytest_libero_max.report.formats import (
    NOT_AVAILABLE,
    Change,
    Counts,
    Format,
    Percent,
    Rate,
    counted,
    percent,
)
from pytest_libero_max.report.quantities import Cell, Quantity
from pytest_libero_max.report.render.terminal import aligned
from pytest_libero_max.report.studies.study_document import Executed, Setting, Study
from pytest_libero_max.report.studies.study_section import section_of
from pytest_libero_max.stats.blocks import BestSetting, MeanDifference, SettingDifference, StaleActions


def study_tables(study: Study) -> list[Table]:
    """Return the tables of a study, in the order in which they are read."""
    if study.cases == 0:
        return []
    section = section_of(study)
    tables = [] if section is None else [*section.tables(study)]
    if study.settings:
        tables.append(_settings(study.settings))
        best = {part: study.best[f"{part.lower()}_success"] for part in ("Base", "Dynamic")}
        tables += [_best(part, found) for part, found in best.items() if found.differences and found.count]
    return [*tables, *_arms(study)]


def study_notes(study: Study) -> list[str]:
    """Return the notes on the whole study."""
    if study.cases == 0:
        return ["No case of the study has been measured."]
    done = study.executed
    ways = [_way(done, done.steps_singly, done.queries_singly, "with every arm played by itself")]
    section = section_of(study)
    if section is not None:
        as_pairs = "with a Base for every other arm, as in runs of their own"
        ways.append(_way(done, done.steps_as_pairs, done.queries_as_pairs, as_pairs))
    notes = [study.about] * bool(study.about) + [
        f"{counted(study.cases, 'case')}, {counted(done.arms, 'arm')}. Shared parts of arms were executed "
        f"once: {done.steps:,} steps and {done.queries:,} queries, against {' and '.join(ways)}."
    ]
    if section is not None:
        notes += section.notes(study)
    if len({setting.horizon for setting in study.settings}) > 1:
        notes.append("H differs between the settings, so Q alone does not explain their differences.")
    if any(setting.returned > setting.horizon for setting in study.settings):
        notes.append(
            "A cut chunk is the beginning of a longer one. A policy trained with that H may answer otherwise."
        )
    return notes


def _way(done: Executed, steps: int, queries: int, words: str) -> str:
    """Cost of another way of playing the same arms, in words."""
    saved = 1 - done.steps / steps if steps else 0.0
    return f"{steps:,} and {queries:,} {words} ({percent(saved)} of the steps saved)"


def study_lines(study: Study) -> list[str]:
    """Return the study for the terminal: title, short tables and notes on the whole."""
    lines = ["", f"Study: {study.title}"]
    for table in study_tables(study):
        if table.narrow:
            lines += ["", *aligned([row[: table.narrow] for row in (table.headings(), *table.texts())])]
    for note in study_notes(study):
        lines += ["", *wrap(note, 100)]
    return lines


def _arms(study: Study) -> Iterator[Table]:
    """Yield success of arms, and where they are compared by event, the contrasts of all cases and of each."""
    if study.arms is None:
        return
    titles = {name: f"{name} ({study.ways[name]})" if name in study.ways else name for name in study.arms}
    yield Table(
        "Success by arm",
        ("Arm", "Success"),
        [(titles[name], Cell(rate, Rate())) for name, rate in study.arms.items()],
        "Each arm over the cases that were played in it. All other numbers are of base and dynamic.",
        narrow=2,
    )
    if study.by_event is None:
        return
    yield Table(
        "Success by arm and event",
        ("Event", *titles.values()),
        [
            (event, *(Cell(rates[arm], Counts()) if arm in rates else "" for arm in study.arms))
            for event, rates in study.by_event.items()
        ],
        narrow=1 + len(study.arms),
    )
    contrasts = study.contrasts or []
    names = list(dict.fromkeys(f"{titles[row.first]} - {titles[row.second]}" for row in contrasts))
    table = Table(
        "Contrasts of arms",
        ("Event", *names),
        [
            (
                event or "all",
                *(Cell(row, Change()) if row.cases else "" for row in contrasts if row.event == event),
            )
            for event in dict.fromkeys(row.event for row in contrasts)
        ],
        "Over the cases that were played in both arms.",
        narrow=1 + len(names),
    )
    yield table.explaining_intervals("Exact 95% intervals, each for itself.")


# Settings: cadence, latency and policy.


@dataclass(frozen=True)
class _Stale(Format):
    """Median and mean of stale actions."""

    def long(self, value: StaleActions) -> str:
        return NOT_AVAILABLE if value.mean is None else f"{value.median:g} / {value.mean:.2f}"

    def numbers(self, value: StaleActions) -> dict[str, float | None]:
        return {"_median": value.median, "_mean": value.mean}


@dataclass(frozen=True)
class _Cost(Format):
    """A difference from the run's own setting, which itself has none."""

    has_interval: ClassVar[bool] = True

    def long(self, value: MeanDifference | None) -> str:
        return "reference" if value is None else Change().long(value)

    def numbers(self, value: MeanDifference | None) -> dict[str, float | None]:
        return {} if value is None else Change().numbers(value)


_SETTING: tuple[Quantity[Setting], ...] = (
    Quantity("base_success", "Base", lambda row: row.base_success, Rate()),
    Quantity("dynamic_success", "Dynamic", lambda row: row.dynamic_success, Rate()),
    Quantity("paired_change", "Change", lambda row: row.paired_change, Change()),
    Quantity("base_cost", "Base less own", lambda row: row.base_cost, _Cost()),
    Quantity("dynamic_cost", "Dynamic less own", lambda row: row.dynamic_cost, _Cost()),
    Quantity("lost", "Lost", lambda row: row.conditional_regression.value, Percent()),
    Quantity("response_coverage", "Query after", lambda row: row.response_coverage, Counts()),
    Quantity("stale", "Stale", lambda row: row.stale_actions, _Stale()),
    Quantity("held", "Waiting", lambda row: row.held, Percent()),
)
"""The columns of the table of settings."""

_LESS_OWN = (
    "Less own: success less that of the run's own Base or Dynamic, over the same cases. Stale: median / mean "
    "of the steps from the event to the first action that a later query returned: a delay of feedback, no "
    "measure of safety. A smaller change alone is not a better result: read it with Dynamic success."
)
_OWN_PREFIX = "Each cadence and each latency has its own executed prefix."
_AFTER = (
    "X after Y: policy Y plays Base and the executed prefix, policy X goes on from the event. Its Change and "
    "Lost are against the Base of Y."
)
_CADENCE = "H: actions that a query returns. Q: actions executed before the next query."
_LATE = (
    "d: control steps that an answer takes. Meanwhile the robot executes the previous chunk, or with sync "
    "waits. Waiting: share of the steps without an action to execute."
)


def _settings_note(settings: Sequence[Setting]) -> str:
    """Return the help for reading the table, without what these settings do not have."""
    late = any(setting.steps for setting in settings)
    cadences = len({(setting.horizon, setting.query_interval) for setting in settings}) > 1
    parts = [
        _CADENCE if cadences else "",
        _LATE if late else "",
        _OWN_PREFIX if late or cadences else "",
        _AFTER if any(setting.policy for setting in settings) else "",
        _LESS_OWN,
    ]
    return " ".join(filter(None, parts))


def setting_text(setting: Setting) -> str:
    """Return the setting in words, ``H=30 (cut to 2) Q=2`` where the policy returned 30 actions."""
    cut = f"H={setting.returned} (cut to {setting.horizon})"
    label = setting.label
    if setting.returned > setting.horizon:
        label = label.replace(f"H={setting.horizon}", cut)
    return label + " (own)" * setting.own


def _settings(settings: list[Setting]) -> Table:
    late = any(setting.steps for setting in settings)
    columns = [one for one in _SETTING if late or one.key != "held"]
    rows = [(setting_text(setting), setting) for setting in settings]
    return table_of("Settings", "Setting", columns, rows, note=_settings_note(settings), narrow=4)


def _best(what: str, best: BestSetting) -> Table:
    equal = any(difference.value == 0 for difference in best.differences.values())
    rows: list[tuple[Any, ...]] = [(best.setting, Cell(best, Rate()), "equal highest" if equal else "best")]
    for name, difference in best.differences.items():
        verdict = "not shown to be worse" if name in best.not_worse else "worse"
        verdict = "n/a" if difference.lower is None else verdict
        verdict = "equal highest" if difference.value == 0 else verdict
        rows.append((name, Cell(_turned(difference), Change()), verdict))
    table = Table(
        f"Highest success in {what}",
        ("Setting", "Success, then differences from it", "Verdict"),
        rows,
        narrow=3,
    )
    return table.explaining_intervals(
        "The intervals account for the choice: those of all rates hold together with 95%, and so do those of "
        "the differences of all pairs of settings."
    )


def _turned(difference: SettingDifference) -> SettingDifference:
    def negative(value: float | None) -> float | None:
        return None if value is None else 0.0 - value

    return SettingDifference(
        value=negative(difference.value), lower=negative(difference.upper), upper=negative(difference.lower)
    )
