"""Pairs during a training with PyTorch Lightning's own Trainer."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.lab.training import PairedEval
from tests.evaluation.test_evaluate import Reacher
from tests.plugin.conftest import BUDGET, tiny_manifest
from tests.short_episodes import shorten_here

pytestmark = pytest.mark.filterwarnings("ignore")  # Lightning's, of its loaders and loggers


def fit(folder: Path, callbacks: list[Any]) -> list[Any]:
    """The weights of a network after four steps of the Trainer, each of two batches."""
    torch: Any = pytest.importorskip("torch", reason="torch")
    lightning: Any = pytest.importorskip("lightning.pytorch", reason="lightning")
    from lightning.pytorch.loggers import CSVLogger

    class Module(lightning.LightningModule):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.network = torch.nn.Sequential(
                torch.nn.Linear(4, 8), torch.nn.Dropout(), torch.nn.Linear(8, 7)
            )

        def training_step(self, batch: Any, place: int) -> Any:
            return self.network(batch[0]).square().mean()

        def configure_optimizers(self) -> Any:
            return torch.optim.Adam(self.parameters())

    torch.manual_seed(3)
    data = torch.utils.data.TensorDataset(torch.randn(16, 4))
    module = Module()
    trainer = lightning.Trainer(
        accelerator="cpu",
        max_steps=4,
        accumulate_grad_batches=2,
        logger=CSVLogger(folder, name="log", version=""),
        callbacks=callbacks,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
    )
    trainer.fit(module, torch.utils.data.DataLoader(data, batch_size=2, shuffle=True))
    return [values.detach().clone() for values in module.parameters()]


def test_the_trainer_evaluates_after_steps_of_the_optimizer_and_logs_the_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch: Any = pytest.importorskip("torch", reason="torch")
    pytest.importorskip("lightning.pytorch", reason="lightning")
    from pytest_libero_max.lab.training.lightning import PairedEvalCallback

    shorten_here(monkeypatch, BUDGET)
    monkeypatch.chdir(tmp_path)
    Path("tiny.json").write_text(json.dumps(tiny_manifest()))
    alone = fit(tmp_path / "alone", [])
    paired = PairedEval(Reacher(), every=2, manifest="tiny.json", substrate="tiny", limit=2)
    weights = fit(tmp_path / "with", [PairedEvalCallback(paired)])
    assert [each.step for each in paired.history] == [2, 4]
    assert all(torch.equal(one, other) for one, other in zip(alone, weights, strict=True))
    with (tmp_path / "with" / "log" / "metrics.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["pairs/played"]]
    assert [(row["step"], float(row["pairs/played"])) for row in rows] == [("2", 2.0), ("4", 2.0)]
