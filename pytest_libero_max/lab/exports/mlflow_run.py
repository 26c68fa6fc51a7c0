"""MLflow: the numbers of a run, a table of its pairs, its films of regressions, and its files.

Where the program has a run of MLflow open, as a training has, everything goes into that one. Otherwise a run
is written into a store in the folder, which ``mlflow ui --backend-store-uri=sqlite:///FOLDER/mlflow.db``
shows.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pytest_libero_max.lab.exports.tracked import COLUMNS, PREFIX, Tracked, required, tracked
from pytest_libero_max.report.exports import ExportedRun
from pytest_libero_max.report.writers.report_files import make_folder

_NAME = "mlflow"
_STORE = "mlflow.db"


def write(run: ExportedRun, place: Path) -> list[Path]:
    """Log a run, into the open run of MLflow or a new one in a store in the folder."""
    mlflow = required("mlflow", _NAME)
    shown, active = tracked(run), mlflow.active_run()
    if active is not None:
        _log(mlflow.MlflowClient(), active.info.run_id, run, shown)
        return []
    make_folder(place)
    client = mlflow.MlflowClient(f"sqlite:///{(place / _STORE).absolute()}")
    known = client.get_experiment_by_name(_EXPERIMENT)
    artifacts = (place / "artifacts").absolute().as_uri()
    experiment = known.experiment_id if known else client.create_experiment(_EXPERIMENT, artifacts)
    made = client.create_run(experiment, run_name=run.folder.absolute().name)
    for name in ("track", "selection", "substrate"):
        client.log_param(made.info.run_id, name, shown.settings[name])
    _log(client, made.info.run_id, run, shown)
    client.set_terminated(made.info.run_id)
    return [place / _STORE]


_EXPERIMENT = "libero-max"


def _log(client: Any, run_id: str, run: ExportedRun, shown: Tracked) -> None:
    for name, number in shown.numbers.items():
        client.log_metric(run_id, name, number, step=run.step)
    folder = f"{PREFIX}/step-{run.step}"
    rows = dict(zip(COLUMNS, map(list, zip(*shown.rows, strict=True)), strict=False))
    client.log_table(run_id, rows, f"{folder}/pairs.json")
    for film in shown.films.values():
        client.log_artifact(run_id, str(film), f"{folder}/films")
    for path in shown.files:
        client.log_artifact(run_id, str(path), folder)
