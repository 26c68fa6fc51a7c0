"""An evaluation that leaves a training as it was: its generators, its gradients, the modes of its modules."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from pytest_libero_max.worlds.global_generators import global_generators_restored


@contextmanager
def undisturbed(model: Any = None) -> Iterator[None]:
    """Put back, after the block, what an evaluation in the process of a training changes.

    These are the global generators of Python, NumPy and PyTorch, from which a training draws its batches and
    its noise, whether gradients are recorded, and for each module of the model whether it trains. In the
    block the model is in evaluation mode, and no gradient is recorded.

    Args:
        model: The PyTorch module that is trained; None where the policy takes care of its mode.
    """
    torch: Any = sys.modules.get("torch")  # a training with PyTorch has imported it
    modes = {} if model is None else {module: module.training for module in model.modules()}
    with ExitStack() as stack:
        stack.enter_context(global_generators_restored())
        if torch is not None:
            devices = range(torch.cuda.device_count()) if torch.cuda.is_initialized() else ()
            stack.enter_context(torch.random.fork_rng(devices))
            stack.enter_context(torch.no_grad())
        try:
            if model is not None:
                model.eval()
            yield
        finally:
            for module, training in modes.items():
                module.training = training
