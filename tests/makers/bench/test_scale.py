from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_libero_max.makers.bench.scale import READ_MIB, Scale, scale_lines, simulate

FEW = Scale(workers=4, pairs=400, pair_s=3.0)


def test_a_single_worker_plays_one_pair_after_another() -> None:
    run = simulate(Scale(workers=1, pairs=5, pair_s=2.0), seed=7)
    durations = np.random.Generator(np.random.PCG64(7)).exponential(2.0, 5)
    assert run.play_s == pytest.approx(durations.sum() + 0.0014)
    assert run.delay_s == pytest.approx(0.0014)
    assert run.idle == 0.0


def test_workers_beyond_what_the_controller_takes_in_only_wait() -> None:
    enough, many = (Scale(workers, 60_000, 1.0, record_ms=2.0) for workers in (100, 2000))
    assert simulate(enough).idle < 0.001
    run = simulate(many)
    assert run.idle > 0.5
    assert run.busy == pytest.approx(1.0, abs=0.05)
    assert run.play_s >= many.pairs * 0.002
    assert run.first_limit == "controller"


def test_more_workers_never_take_longer_to_play_and_the_same_run_comes_out_again() -> None:
    runs = [simulate(replace(FEW, workers=workers)) for workers in (4, 8, 16, 32)]
    assert [run.play_s for run in runs] == sorted((run.play_s for run in runs), reverse=True)
    assert runs[0] == simulate(FEW)


def test_a_machine_reads_once_for_all_its_workers() -> None:
    scale = Scale(workers=33, pairs=33, pair_s=1.0, files_mib_s=READ_MIB, workers_a_machine=16)
    assert scale.read_s == 3.0


def test_the_table_has_a_line_for_each_run() -> None:
    heading, rule, *rows = scale_lines([FEW, replace(FEW, pair_s=1.0)])
    assert len(rows) == 2
    assert {line.count("|") for line in (heading, rule, *rows)} == {heading.count("|")}
