"""Runs with and without restoration on the same cases: what is computed, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.errors import ReportError
from pytest_libero_max.lab.recovery import compare_recovery, document_of
from pytest_libero_max.report.render.terminal import document_lines
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.store import StoredRun
from tests.report.made_up import POLICY, PROVENANCE, plain, plan, record_of

PLANNED = [pair for pair in plan(30) if pair.event == "sensor_noise_onset"]  # 60 of plus, 60 of pro
Flags = Sequence[bool]
COUNTS = ("queries", "active", "images", "restored", "noisy", "covered")


def run_of(mode: str, base: Flags, dynamic: Flags, **policy: Any) -> StoredRun:
    spec = {**POLICY, **policy, **({} if mode == "native" else {"wrappers": [f"restore={mode}"]})}
    records = []
    for number, (pair, first, second) in enumerate(zip(PLANNED, base, dynamic, strict=True)):
        record = record_of(pair, first, second, policy=spec, task_index=number, timings={"restore_s": 0.3})
        if mode != "native":
            counts = ((10, 1, 20, 2, 2, 1), (20, 20, 40, 40, 39, 38))
            arms = {
                name: structs.replace(record.arm(name), notes=dict(zip(COUNTS, values, strict=True)))
                for name, values in zip(("base", "dynamic"), counts, strict=True)
            }
            record = structs.replace(record, arms=arms)
        records.append(record)
    wrap = {} if mode == "native" else {"wrap": {"restore": mode}}
    provenance = {**PROVENANCE, "policy": {**PROVENANCE["policy"], **wrap}}
    return StoredRun(Run(tuple(PLANNED), provenance), tuple(records), (), torn=False)


def flags(*parts: tuple[int, bool]) -> list[bool]:
    """So many cases each; what is left is False."""
    values = [value for count, value in parts for _ in range(count)]
    return values + [False] * (len(PLANNED) - len(values))


NATIVE = run_of("native", flags((80, True)), flags((48, True)))
ALWAYS = run_of("always", flags((82, True)), flags((57, True)))
# Succeeds in 33 cases in which native fails, and fails in 12 in which native succeeds.
GATED = run_of("gated", flags((81, True)), flags((12, False), (69, True)))


def test_gains_and_gap_closure_are_differences_over_the_same_cases() -> None:
    recovery = compare_recovery([GATED, NATIVE, ALWAYS])
    effects = {(row["mode"], row["over"], row["quantity"]): row for row in plain(recovery)["effects"]}
    assert list(plain(recovery)["modes"]) == ["native", "always", "gated"]
    assert [(mode, quantity) for mode, _, quantity in effects] == [
        *(("gated", name) for name in ("dynamic", "base", "closure")),
        *(("always", name) for name in ("dynamic", "base", "closure")),
        ("gated", "dynamic"),
    ]
    gain, base, closure = (effects["gated", "native", name] for name in ("dynamic", "base", "closure"))
    assert (gain["gained"], gain["lost"], gain["value"]) == (33, 12, pytest.approx(21 / 120))
    assert base["value"] == pytest.approx(1 / 120)
    assert closure["value"] == pytest.approx(gain["value"] - base["value"])
    assert effects["gated", "always", "dynamic"]["value"] == pytest.approx((69 - 57) / 120)
    for row in (gain, closure):
        assert (
            row["lower"] < row["bootstrap"]["lower"] < row["value"] < row["bootstrap"]["upper"] < row["upper"]
        )


def test_an_interval_needs_enough_cases_that_changed() -> None:
    effects = plain(compare_recovery([NATIVE, ALWAYS]))["effects"]
    base = next(row for row in effects if row["quantity"] == "base")
    assert (base["changed_configurations"], base["bootstrap"]["lower"]) == (2, None)
    assert base["lower"] < 0 < base["upper"]


def test_groups_are_the_sources_and_the_corruptions() -> None:
    groups = plain(compare_recovery([NATIVE, GATED]))["groups"]
    assert [(row["name"], row["pairs"]) for row in groups] == [
        ("plus", 60),
        ("pro", 60),
        ("noise 24, mask 8%", 60),
        ("noise 36, mask 16%", 60),
    ]
    assert sum(row["gained"] for row in groups[:2]) == sum(row["gained"] for row in groups[2:]) == 33


def test_activation_and_cost_are_of_the_queries_that_were_asked() -> None:
    gated = plain(compare_recovery([NATIVE, GATED]))["modes"]["gated"]
    assert gated["active"]["base"] == {"count": 120, "of": 1200, "value": 0.1}
    assert gated["active"]["dynamic"]["value"] == 1.0
    assert gated["seconds_per_query"] == pytest.approx(0.3 / 30)
    native = plain(compare_recovery([NATIVE, GATED]))["modes"]["native"]
    assert native["active"] == {"base": None, "dynamic": None}
    assert native["seconds_per_query"] is None


def test_the_text_names_modes_effects_and_limits() -> None:
    lines = document_lines(document_of(compare_recovery([NATIVE, ALWAYS, GATED])))
    text = "\n".join(lines)
    assert max(map(len, lines)) <= 112
    assert "120 common cases" in text
    assert "gated - native" in text
    assert re.search(r" 33 +12$", text, re.M)
    assert "10.0%  120/1200" in text


@pytest.mark.parametrize(
    ("runs", "message"),
    [
        ([NATIVE, NATIVE], "Two runs have restore='native'"),
        ([ALWAYS, GATED], "one must have none"),
        ([NATIVE], "one must have none"),
        ([NATIVE, run_of("gated", flags(), flags(), horizon=20)], "different policies or settings"),
    ],
)
def test_runs_that_are_no_recovery_are_refused(runs: list[StoredRun], message: str) -> None:
    with pytest.raises(ReportError, match=message):
        compare_recovery(runs)


def test_runs_that_differ_in_more_than_the_restoration_are_refused() -> None:
    provenance = GATED.run.provenance | {"protocol": {"prefix": "fork", "latency": "4steps"}}
    other = replace(GATED, run=structs.replace(GATED.run, provenance=provenance))
    with pytest.raises(ReportError, match="differ in latency"):
        compare_recovery([NATIVE, other])


def test_another_event_is_refused() -> None:
    def moved(run: StoredRun) -> StoredRun:
        pair = structs.replace(PLANNED[0], event="camera_shift", family="observation")
        planned: tuple[PlannedPair, ...] = (pair, *PLANNED[1:])
        record = structs.replace(run.records[0], event="camera_shift")
        return replace(run, run=Run(planned, PROVENANCE), records=(record, *run.records[1:]))

    with pytest.raises(ReportError, match="hold pairs of camera_shift"):
        compare_recovery([moved(NATIVE), moved(GATED)])
