"""Pairs during a training with PyTorch Lightning."""

from __future__ import annotations

from typing import Any

import lightning.pytorch

from pytest_libero_max.lab.training.paired_eval import PairedEval

__all__ = ["PairedEvalCallback"]


class PairedEvalCallback(lightning.pytorch.Callback):  # type: ignore[misc]  # untyped where it is not installed
    """Evaluates after the steps of a Trainer, and logs the numbers with its loggers.

    Steps are those of ``trainer.global_step``: steps of the optimizer. The module is in evaluation mode
    meanwhile. In a training of several processes the first one plays, and the others wait at their next
    step::

        trainer = Trainer(callbacks=[PairedEvalCallback(PairedEval(policy, every=1000))])

    Args:
        paired: What is played. Its ``model`` is the module that is trained, unless it has one.
    """

    def __init__(self, paired: PairedEval) -> None:
        self._paired = paired

    def on_train_batch_end(self, trainer: Any, pl_module: Any, *args: Any, **kwargs: Any) -> None:
        if self._paired.model is None:
            self._paired.model = pl_module
        evaluated = self._paired(trainer.global_step)
        if evaluated is not None:
            for logger in trainer.loggers:
                logger.log_metrics(evaluated.numbers, step=evaluated.step)
