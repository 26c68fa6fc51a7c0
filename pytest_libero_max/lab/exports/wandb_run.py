"""Weights & Biases: the numbers of a run, a table of its pairs, its films of regressions, and its files.

Where the program has a run of Weights & Biases open, as a training has, everything goes into that one.
Otherwise a run of its own is written into the folder, offline unless ``WANDB_MODE`` says otherwise;
``wandb sync`` sends it.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

from pytest_libero_max.lab.exports.tracked import COLUMNS, PREFIX, Tracked, gif_of, required, tracked
from pytest_libero_max.report.exports import ExportedRun
from pytest_libero_max.report.writers.report_files import make_folder

_NAME = "wandb"


def write(run: ExportedRun, place: Path) -> list[Path]:
    """Log a run, into the open run of Weights & Biases or a new one in the folder."""
    wandb = required("wandb", _NAME)
    shown = tracked(run)
    if wandb.run is not None:
        _log(wandb, wandb.run, run, shown)
        return []
    make_folder(place)
    # Weights & Biases would otherwise wrap the terminal.
    quiet = wandb.Settings(console="off", silent=True)
    mode = os.environ.get("WANDB_MODE", "offline")
    opened = wandb.init(
        dir=str(place), mode=mode, job_type="libero-max", config=shown.settings, settings=quiet
    )
    folder = Path(opened.dir).parent  # of the files is "files" in that of the run
    try:
        _log(wandb, opened, run, shown)
    finally:
        opened.finish()
    return [folder]


def _log(wandb: Any, opened: Any, run: ExportedRun, shown: Tracked) -> None:
    """Log a run with its own axis of steps, so that a training may log at any step of its own."""
    step = f"{PREFIX}/step"
    opened.define_metric(step, hidden=True)
    opened.define_metric(f"{PREFIX}/*", step_metric=step)
    values = {step: run.step, **shown.numbers}
    values[f"{PREFIX}/pairs"] = wandb.Table(columns=[*COLUMNS], data=shown.rows)
    with tempfile.TemporaryDirectory() as folder:
        for name, film in shown.films.items():
            if film.suffix != ".mp4":  # it takes no WebP
                content, film = gif_of(film)[0], Path(folder, f"{film.stem}.gif")
                film.write_bytes(content)
            values[f"{PREFIX}/films/{name}"] = wandb.Video(str(film), format=film.suffix[1:], caption=name)
        opened.log(values)
    files = wandb.Artifact(f"libero-max-{opened.id}", type="evaluation", metadata={"step": run.step})
    for path in shown.files:
        files.add_file(str(path))
    opened.log_artifact(files)
