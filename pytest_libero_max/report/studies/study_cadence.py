"""Query cadence and latency: outcomes, stale actions and best setting of a sweep, from the records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec.structs import asdict

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.studies.study_document import (
    Cadence,
    CadenceSetting,
    Latencies,
    LatencySetting,
    SettingChange,
)
from pytest_libero_max.stats.best import best_of
from pytest_libero_max.stats.blocks import MeanDifference
from pytest_libero_max.stats.exposure import expose
from pytest_libero_max.stats.intervals import mean_change
from pytest_libero_max.stats.measured import (
    interval_of,
    number,
    rate_of,
    table_change_of,
)
from pytest_libero_max.stats.outcome_table import BoolArray, tabulate
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.studies.cadence_sweep import CadenceSweep, setting_arm
from pytest_libero_max.studies.latency_sweep import LatencySweep, delay_arm
from pytest_libero_max.worlds.contract import CONTROL_HZ


@dataclass(frozen=True)
class Setting:
    """A setting of a sweep as it was played."""

    horizon: int
    """H."""
    query_interval: int
    """Q."""
    base: str
    """Name of its Base arm."""
    dynamic: str
    """Name of its Dynamic arm."""
    own: bool
    """True for the policy's own cadence."""

    @property
    def label(self) -> str:
        return f"H={self.horizon} Q={self.query_interval}"


def settings_of(study: CadenceSweep, policy: Json) -> list[Setting]:
    """All settings by Q and then H, the policy's own one included.

    A setting that is the policy's own cadence is the pair of Base and Dynamic.

    Args:
        study: The sweep.
        policy: The policy's spec as played.
    """
    own = Setting(policy["horizon"], policy["query_interval"], BASE, DYNAMIC, own=True)
    settings = {own.label: own}
    for asked in study.settings:
        horizon = policy["horizon"] if asked.horizon is None else asked.horizon
        base, dynamic = (setting_arm(name, asked) for name in (BASE, DYNAMIC))
        setting = Setting(horizon, asked.query_interval, base, dynamic, own=False)
        settings.setdefault(setting.label, setting)
    return sorted(settings.values(), key=lambda setting: (setting.query_interval, setting.horizon))


def cadence_results(study: CadenceSweep, records: Sequence[PairRecord]) -> Cadence:
    """Compute everything that is reported of a sweep.

    Raises:
        ReportError: A record lacks an arm of the study.
    """
    if not records:
        return Cadence(settings=[], best={})
    settings = settings_of(study, records[0].policy)
    return Cadence(
        settings=[_setting(setting, records) for setting in settings],
        best={
            "base_success": best_of({one.label: _successes(records, one.base) for one in settings}),
            "dynamic_success": best_of({one.label: _successes(records, one.dynamic) for one in settings}),
        },
    )


def latency_results(study: LatencySweep, records: Sequence[PairRecord]) -> Latencies:
    """Compute everything that is reported of a latency sweep.

    Raises:
        ReportError: A record lacks an arm of the study.
    """
    settings = sorted({NO_LATENCY, *study.settings}, key=lambda setting: (setting.steps, setting.runner))
    return Latencies(settings=[_delayed(setting, records) for setting in settings] if records else [])


def _delayed(setting: Latency, records: Sequence[PairRecord]) -> LatencySetting:
    own = setting == NO_LATENCY
    base, dynamic = (name if own else delay_arm(name, setting) for name in (BASE, DYNAMIC))
    arms = [record.arm(name) for record in records for name in (base, dynamic)]
    held = Ratio(sum(arm.held_steps or 0 for arm in arms), sum(arm.steps for arm in arms))
    delay = f"d={setting.steps} ({1000 * setting.steps // CONTROL_HZ} ms)"
    return LatencySetting(
        label=delay + (" sync" if setting.runner == "sync" else ""),
        own=own,
        steps=setting.steps,
        runner=setting.runner,
        base_cost=_less(_successes(records, base), _successes(records, BASE)),
        dynamic_cost=_less(_successes(records, dynamic), _successes(records, DYNAMIC)),
        held=number(held.value),
        **_measured(base, dynamic, records),
    )


def _less(late: BoolArray, none: BoolArray) -> MeanDifference:
    return table_change_of(tabulate(none, late))


def _setting(setting: Setting, records: Sequence[PairRecord]) -> CadenceSetting:
    return CadenceSetting(
        label=setting.label,
        horizon=setting.horizon,
        query_interval=setting.query_interval,
        own=setting.own,
        returned=_whole_chunk(setting, records),
        **_measured(setting.base, setting.dynamic, records),
    )


def _measured(base_arm: str, dynamic_arm: str, records: Sequence[PairRecord]) -> dict[str, Any]:
    """Return what is reported of every setting of a sweep, by field."""
    base, dynamic = (_successes(records, arm) for arm in (base_arm, dynamic_arm))
    outcomes = tabulate(base, dynamic)
    arms: list[ArmRecord] = [record.arm(dynamic_arm) for record in records]
    triggered = Ratio(sum(bool(arm.firings) for arm in arms), len(arms))
    responded = Ratio(sum(arm.response_step is not None for arm in arms), len(arms))
    stale = [arm.stale_actions or 0 for arm in arms if arm.response_step is not None]
    bootstrap = mean_change(dynamic.astype(np.int64) - base, [record.source for record in records])
    return {
        "base_success": rate_of(outcomes.base),
        "dynamic_success": rate_of(outcomes.dynamic),
        "paired_change": SettingChange(
            **asdict(table_change_of(outcomes)), bootstrap_by_source=interval_of(bootstrap)
        ),
        "outcomes": outcomes,
        "conditional_regression": rate_of(outcomes.conditional_regression),
        "trigger_coverage": rate_of(triggered),
        "response_coverage": rate_of(responded),
        "stale_actions": expose(stale, unanswered=triggered.count - responded.count),
    }


def _whole_chunk(setting: Setting, records: Sequence[PairRecord]) -> int:
    """Return the number of actions of a chunk before it was cut to the setting's H."""
    spans = (record.arm(name).returned for record in records for name in (setting.base, setting.dynamic))
    own: int = records[0].policy["horizon"]
    return max([setting.horizon, own, *(span[1] for span in spans if span)])


def _successes(records: Sequence[PairRecord], arm: str) -> BoolArray:
    return np.array([record.arm(arm).success for record in records], dtype=np.bool_)
