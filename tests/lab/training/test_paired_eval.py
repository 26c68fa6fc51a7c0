"""Pairs during a training: when they are played, what is logged, and a training that does not notice them."""

from __future__ import annotations

import json
import logging
import random
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max import Episode, Query, read_pairs
from pytest_libero_max.errors import DiskError, OptionError
from pytest_libero_max.lab.training import PairedEval, paired_eval
from pytest_libero_max.lab.training.paired_eval import Evaluated, undisturbed
from pytest_libero_max.report.exports import EXPORTS
from tests.evaluation.test_evaluate import SPEC, Reacher
from tests.plugin.conftest import BUDGET, tiny_manifest
from tests.short_episodes import shorten_here

HOW: dict[str, Any] = {"manifest": "tiny.json", "substrate": "tiny", "limit": 2}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with a manifest; episodes here are short."""
    shorten_here(monkeypatch, BUDGET)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tiny.json").write_text(json.dumps(tiny_manifest()))
    return tmp_path


def test_pairs_are_played_every_so_many_steps_and_once_for_a_step(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    logged: list[tuple[int, dict[str, float]]] = []
    policy = Reacher()
    paired = PairedEval(
        policy, every=2, folder="runs", log=lambda numbers, step: logged.append((step, numbers)), **HOW
    )
    with caplog.at_level(logging.INFO, logger="pytest_libero_max"):
        results = [paired(step) for step in (0, 1, 2, 2, 3, 4)]
    assert [None if each is None else each.step for each in results] == [None, None, 2, None, None, 4]
    assert [each.step for each in paired.history] == [step for step, _ in logged] == [2, 4]
    assert logged[0][1]["pairs/played"] == logged[0][1]["pairs/planned"] == 2
    runs = [read_pairs(folder / "runs" / f"step-{step:08d}") for step in (2, 4)]
    assert [run.records[0].policy["revision"] for run in runs] == ["step-2", "step-4"]
    assert [run.run.provenance["order"] for run in runs] == ["shuffled:0"] * 2
    assert [run.run.provenance["stopping_rule"] for run in runs] == ["anytime:0.05"] * 2
    assert [pair.case_id for pair in runs[0].run.planned] == [pair.case_id for pair in runs[1].run.planned]
    assert policy.spec is SPEC
    (line,) = [text for text in caplog.messages if text.startswith("step 2: ")]
    assert "Base 0.0%, Dynamic 0.0%" in line
    assert len(repr(paired.history[0])) < 100


def test_gates_and_another_rule_are_those_of_evaluate(folder: Path) -> None:
    paired = PairedEval(Reacher(), every=1, stop=None, gates=["base_sr >= 0.5"], **HOW)
    evaluated = paired(1)
    assert evaluated is not None
    assert [gate.verdict for gate in evaluated.result.gates] == ["failed"]
    assert "gate" in str(evaluated)
    run = read_pairs(evaluated.result.folder)
    assert run.run.provenance.get("stopping_rule") is None


def test_an_evaluation_that_fails_is_logged_and_the_training_goes_on(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    paired = PairedEval(Reacher(), every=1, **HOW)

    def full(*_: object, **__: object) -> None:
        raise DiskError("No space left.")

    with monkeypatch.context() as patched:
        patched.setattr(paired_eval, "evaluate", full)
        assert paired(1) is None
    assert "no evaluation" in caplog.text
    assert paired(2) is not None
    assert [each.step for each in paired.history] == [2]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"every": 0}, "every=0, but must be"),
        ({"every": True}, "every=True, but must be"),
        ({"every": 1, "films": -1}, "films=-1, but must be"),
        ({"every": 1, "exports": ["tensorboard"]}, "FORMAT=FOLDER"),
        ({"every": 1, "exports": ["tensorbord=x"]}, "'tensorboard'"),
    ],
)
def test_what_is_asked_for_wrongly_is_refused_before_the_training(
    asked: dict[str, Any], message: str
) -> None:
    with pytest.raises(OptionError, match=message):
        PairedEval(Reacher(), **asked)


def test_an_argument_that_evaluate_does_not_know_is_raised(folder: Path) -> None:
    with pytest.raises(OptionError, match="no argument 'trak'"):
        PairedEval(Reacher(), every=1, trak="smoke")(1)


def test_a_run_is_exported_with_its_step(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    exported: list[tuple[str, int, Path]] = []
    for name in ("tensorboard", "mlflow"):
        export = partial(lambda name, run, place: exported.append((name, run.step, place)), name)
        monkeypatch.setitem(EXPORTS._loaded, name, export)
    PairedEval(Reacher(), every=3, exports=["tensorboard=logs", "mlflow=x"], **HOW)(3)
    assert exported == [("tensorboard", 3, Path("logs")), ("mlflow", 3, Path("x"))]


def test_generators_are_put_back() -> None:
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002
    expected = random.random(), np.random.random()  # noqa: NPY002
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002
    with undisturbed():
        random.random(), np.random.random()  # noqa: NPY002
    assert (random.random(), np.random.random()) == expected  # noqa: NPY002


def trained(paired: Callable[[int], Evaluated | None] | None, attach: bool = False) -> tuple[Any, Any]:
    """The weights of a small network after six steps with dropout and drawn batches, and the network."""
    torch: Any = pytest.importorskip("torch", reason="torch")
    torch.manual_seed(3)
    model = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.Dropout(0.5), torch.nn.Linear(8, 7))
    optimizer = torch.optim.Adam(model.parameters())
    if isinstance(paired, PairedEval):
        paired.model = model
    if attach:
        assert isinstance(paired, PairedEval)
        paired.attach(optimizer)
    for step in range(1, 7):
        optimizer.zero_grad()
        model(torch.randn(5, 4)).square().sum().backward()
        optimizer.step()
        if paired is not None and not attach:
            paired(step)
    return [values.detach().clone() for values in model.parameters()], model


class Drawn(Reacher):
    """A policy that draws from PyTorch's and NumPy's generators, and sees in which mode the network is."""

    def __init__(self) -> None:
        super().__init__()
        self.model: Any = None
        self.modes: set[tuple[bool, bool]] = set()

    def predict(self, observation: Any, query: Query) -> Any:
        torch: Any = pytest.importorskip("torch")
        torch.randn(3)
        np.random.random()  # noqa: NPY002
        self.modes.add((self.model.training, torch.is_grad_enabled()))
        return super().predict(observation, query)

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        self.model = self.paired.model

    paired: PairedEval


@pytest.mark.parametrize("attach", [False, True])
def test_a_training_ends_with_the_same_weights_as_without_evaluations(folder: Path, attach: bool) -> None:
    torch: Any = pytest.importorskip("torch", reason="torch")
    alone, _ = trained(None)
    policy = Drawn()
    policy.paired = paired = PairedEval(policy, every=3, **HOW)
    weights, model = trained(paired, attach)
    assert [each.step for each in paired.history] == [3, 6]
    assert all(torch.equal(one, other) for one, other in zip(alone, weights, strict=True))
    assert policy.modes == {(False, False)}
    assert all(module.training for module in model.modules())
