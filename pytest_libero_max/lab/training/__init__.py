"""Evaluation during a training: for a loop of one's own, PyTorch Lightning and LeRobot's trainer.

:class:`PairedEval` plays pairs every so many steps of a training, and logs what the events do to the policy.
:mod:`.lightning` and :mod:`.lerobot` attach it to the trainers of these names. Nothing here imports PyTorch
before a training has.
"""

from __future__ import annotations

from pytest_libero_max.lab.training.paired_eval import Evaluated, PairedEval

__all__ = ["Evaluated", "PairedEval"]
