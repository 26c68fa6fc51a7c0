"""What trackers get of a run, and what TensorBoard, Weights & Biases and MLflow hold of it afterwards."""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from pytest_libero_max.cli import main
from pytest_libero_max.lab.exports.tracked import COLUMNS, MOST_FILMS, gif_of, markdown_table, tracked
from pytest_libero_max.lab.exports.tracked import tracked_numbers as numbers_of
from pytest_libero_max.report.exports import EXPORTS, ExportedRun
from pytest_libero_max.report.writers.report_files import report_of
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, read_pairs
from tests.report.made_up import PROVENANCE, error_of, plan, record_of
from tests.report.test_stopped_report import stopped_run

QUIET = pytest.mark.filterwarnings("ignore")
"""Trackers warn of what their own packages do."""


def store(folder: Path, outcomes: list[tuple[bool, bool] | None]) -> ExportedRun:
    """A run with these outcomes of Base and Dynamic, None for a pair that could not be measured."""
    pairs = plan()[: len(outcomes)]
    written = PairStore(folder, Run(tuple(pairs), PROVENANCE))
    for pair, outcome in zip(pairs, outcomes, strict=True):
        written.append(error_of(pair) if outcome is None else record_of(pair, *outcome))
    written.close()
    return ExportedRun(folder, read_pairs(folder), step=300)


def film(run: ExportedRun, place: int) -> None:
    """Give the pair of that place a film of three frames."""
    name = run.stored.run.planned[place].item_id
    frames = [Image.new("RGB", (64, 48), (80 * number, 0, 0)) for number in range(3)]
    path = run.folder / "films" / f"{name}--base-dynamic.webp"
    path.parent.mkdir(exist_ok=True)
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=[100, 200, 300], lossless=True)


@pytest.fixture
def run(tmp_path: Path) -> ExportedRun:
    made = store(tmp_path / "run", [(True, False), (True, True), (True, True)])
    film(made, 0)
    film(made, 1)
    return made


def test_trackers_get_numbers_a_row_for_each_pair_and_the_films_of_regressions(run: ExportedRun) -> None:
    shown = tracked(run)
    first = run.stored.run.planned[0].item_id
    assert shown.numbers["libero_max/base_success"] == 1
    assert shown.numbers["libero_max/paired_change"] == pytest.approx(-1 / 3)
    assert shown.numbers["libero_max/causes/not_recorded"] == 1
    assert shown.numbers["libero_max/stopped"] == 0
    assert {*shown.films} == {first}
    rows = {row[0]: dict(zip(COLUMNS, row, strict=True)) for row in shown.rows}
    assert rows[first]["outcome"] == "regression"
    assert (rows[first]["base"], rows[first]["dynamic"]) == (True, False)
    assert len(rows) == 3
    assert markdown_table(shown.rows).count("\n") == 5


def test_a_run_that_lacks_a_pair_has_counts_and_no_rate(tmp_path: Path) -> None:
    shown = tracked(store(tmp_path / "run", [(True, False), None]))
    assert shown.numbers["libero_max/pairs/invalid"] == 1
    assert not [
        name for name in shown.numbers if "success" in name.rpartition("/")[2] and "outcomes" not in name
    ]
    assert [row[3] for row in shown.rows if row[4] is None] == ["error"]


def test_where_base_solves_nothing_there_is_no_change_of_zero(tmp_path: Path) -> None:
    shown = tracked(store(tmp_path / "run", [(False, False), (False, False)]))
    assert shown.numbers["libero_max/base_success"] == 0
    assert not [name for name in shown.numbers if "paired_change" in name]


@pytest.mark.parametrize("rule", ["first_regression", "anytime:0.05"])
def test_a_stopped_run_has_its_rates_and_the_interval_of_its_rule_alone(rule: str) -> None:
    stopped = report_of(stopped_run("smoke/stale_expert", rule))
    assert stopped.pairs.stopped is not None
    shown = numbers_of(stopped)
    assert shown["stopped"] == 1
    assert shown["pairs/played"] < shown["pairs/planned"]
    assert shown["dynamic_success"] == stopped.overall.dynamic_success.value
    ends = [(watched.lower, watched.upper) for watched in stopped.pairs.stopped.watched]
    of_rule = (
        []
        if "paired_change_lower" not in shown
        else [(shown["paired_change_lower"], shown["paired_change_upper"])]
    )
    assert of_rule == ends
    assert bool(ends) == rule.startswith("anytime")
    assert "base_success_lower" not in shown


def test_a_film_becomes_a_gif_with_the_same_times(run: ExportedRun) -> None:
    (path,) = tracked(run).films.values()
    content, width, height = gif_of(path)
    with Image.open(io.BytesIO(content)) as picture:
        times = []
        for number in range(picture.n_frames):
            picture.seek(number)
            times.append(picture.info["duration"])
        colour = picture.convert("RGB").getpixel((0, 0))
    assert times == [100, 200, 300]
    assert (width, height) == (64, 48)
    assert colour[0] > 100  # the last frame, not the first one three times


def test_a_tracker_gets_no_more_films_than_somebody_looks_at(tmp_path: Path) -> None:
    run = store(tmp_path / "run", [(True, False)] * (MOST_FILMS + 3))
    for place in range(MOST_FILMS + 3):
        film(run, place)
    assert len(tracked(run).films) == MOST_FILMS


@pytest.mark.parametrize("name", ["tensorboard", "wandb", "mlflow"])
def test_a_tracker_that_is_not_installed_is_named_with_the_command(
    name: str, run: ExportedRun, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in [each for each in sys.modules if each.partition(".")[0] == name]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, name, None)
    assert main(["report", str(run.folder), f"--export={name}={run.folder.parent / 'x'}"]) == 1
    assert f"pip install {name}" in capsys.readouterr().err


def test_tensorboard_reads_numbers_table_and_films(run: ExportedRun) -> None:
    reading = pytest.importorskip(
        "tensorboard.backend.event_processing.event_accumulator", reason="tensorboard"
    )
    place = run.folder.parent / "logs"
    later = ExportedRun(run.folder, run.stored, step=600)
    (first,), (second,) = EXPORTS["tensorboard"](run, place), EXPORTS["tensorboard"](later, place)
    assert first != second
    log = reading.EventAccumulator(str(place)).Reload()
    assert [event.step for event in log.Scalars("libero_max/base_success")] == [300, 600]
    text = log.Tensors("libero_max/pairs")[0].tensor_proto.string_val[0].decode()
    assert text == markdown_table(tracked(run).rows)
    (tag,) = log.Tags()["images"]
    image = log.Images(tag)[0]
    assert image.encoded_image_string.startswith(b"GIF89a")
    assert (image.width, image.height) == (64, 48)


def test_weights_and_biases_keeps_a_run_offline(run: ExportedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("wandb", reason="wandb")
    monkeypatch.delenv("WANDB_MODE", raising=False)
    place = run.folder.parent / "wandb"
    (folder,) = EXPORTS["wandb"](run, place)
    assert folder.is_relative_to(place)
    assert folder.name.startswith("offline-run-")
    content = next(folder.glob("*.wandb")).read_bytes()
    assert b"libero_max/base_success" in content
    assert len([*folder.rglob("*.gif")]) == 1
    assert len([*folder.rglob("*pairs*.table.json")]) == 1


@QUIET
def test_mlflow_shows_metrics_table_and_films(run: ExportedRun) -> None:
    mlflow = pytest.importorskip("mlflow", reason="mlflow")
    place = run.folder.parent / "store"
    (database,) = EXPORTS["mlflow"](run, place)
    client: Any = mlflow.MlflowClient(f"sqlite:///{database}")
    experiment = client.get_experiment_by_name("libero-max")
    (kept,) = client.search_runs([experiment.experiment_id])
    assert kept.data.metrics["libero_max/base_success"] == 1
    assert kept.info.status == "FINISHED"
    names = {
        item.path.rpartition("/")[2]
        for item in client.list_artifacts(kept.info.run_id, "libero_max/step-300")
    }
    assert {"pairs.json", "films", "pairs.jsonl"} <= names


@QUIET
@pytest.mark.parametrize("name", ["wandb", "mlflow"])
def test_an_open_run_of_the_training_gets_the_evaluation(
    name: str, run: ExportedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracker: Any = pytest.importorskip(name, reason=name)
    place = run.folder.parent / "other"
    if name == "wandb":
        opened = tracker.init(
            mode="offline", dir=str(run.folder.parent), settings=tracker.Settings(silent=True)
        )
        assert EXPORTS[name](run, place) == []
        assert opened.summary["libero_max/base_success"] == 1
        opened.finish()
    else:
        tracker.set_tracking_uri(f"sqlite:///{run.folder.parent / 'mlflow.db'}")
        with tracker.start_run() as opened:
            assert EXPORTS[name](run, place) == []
        kept = tracker.MlflowClient().get_run(opened.info.run_id)
        assert kept.data.metrics["libero_max/base_success"] == 1
    assert not place.exists()
    shutil.rmtree(run.folder.parent / "mlruns", ignore_errors=True)
