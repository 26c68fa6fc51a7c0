"""Pairs during a training by LeRobot's trainer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from lerobot.scripts import lerobot_train

from pytest_libero_max.errors import OptionError
from pytest_libero_max.lab.lerobot_policy import LeRobotPolicy
from pytest_libero_max.lab.training.paired_eval import PairedEval

__all__ = ["evaluated_training"]

_REPLACED = ("make_pre_post_processors", "update_policy")
"""Functions that the trainer calls once for its processors, and once for each step."""


@contextmanager
def evaluated_training(**settings: Any) -> Iterator[list[PairedEval]]:
    """Let LeRobot's trainer evaluate by pairs in the block.

    The trainer has no callbacks, so two of its functions are replaced meanwhile: one tells which processors
    the policy has, the other which step has been made. They do what they did before::

        with evaluated_training(every=5000, track="smoke", exports=["tensorboard=logs"]):
            lerobot_train.main()  # with the arguments of lerobot-train

    Args:
        settings: Arguments of :class:`PairedEval` other than ``policy`` and ``model``.

    Yields:
        A list that holds the evaluations of the training once it has begun.

    Raises:
        OptionError: This LeRobot has no such functions.
    """
    lacking = [name for name in _REPLACED if not callable(getattr(lerobot_train, name, None))]
    if lacking:
        raise OptionError(
            f"lerobot.scripts.lerobot_train has no {' and no '.join(lacking)}, where pairs are attached. "
            "Install LeRobot 0.6.1, or evaluate the checkpoints after the training."
        )
    make, update = (getattr(lerobot_train, name) for name in _REPLACED)
    processors: list[Any] = []
    paired: list[PairedEval] = []

    def make_and_keep(*args: Any, **kwargs: Any) -> Any:
        processors[:] = make(*args, **kwargs)
        return tuple(processors)

    def update_and_evaluate(metrics: Any, policy: Any, *args: Any, accelerator: Any, **kwargs: Any) -> Any:
        result = update(metrics, policy, *args, accelerator=accelerator, **kwargs)
        if not paired:
            model = accelerator.unwrap_model(policy)
            paired.append(PairedEval(LeRobotPolicy(model, *processors), model=model, **settings))
        with accelerator.autocast():
            paired[0](metrics.steps + 1)  # the trainer counts the step afterwards
        return result

    lerobot_train.make_pre_post_processors = make_and_keep
    lerobot_train.update_policy = update_and_evaluate
    try:
        yield paired
    finally:
        lerobot_train.make_pre_post_processors, lerobot_train.update_policy = make, update
