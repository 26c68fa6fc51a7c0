"""Pairs that are played every so many steps of a training."""

from __future__ import annotations

import contextlib
import io
import logging
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import LiberoMaxError, OptionError, counted
from pytest_libero_max.evaluation.evaluate import Evaluation, evaluate
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.report.exports import EXPORTS, ExportedRun
from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.report.measurable import is_measurable, lacks_of
from pytest_libero_max.runs.store import read_pairs
from pytest_libero_max.worlds.global_generators import global_generators_restored

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import Policy

__all__ = ["Evaluated", "PairedEval"]

LOG = logging.getLogger("pytest_libero_max")

Log = Callable[[dict[str, float], int], object]
"""Takes numbers by their name, and the step of the training."""


@contextmanager
def undisturbed(model: Any = None) -> Iterator[None]:
    """Put back, after the block, what an evaluation in the process of a training changes.

    These are the global generators of Python, NumPy and PyTorch, from which a training draws its batches and
    its noise, whether gradients are recorded, and for each module of the model whether it trains. In the
    block the model is in evaluation mode, and no gradient is recorded.
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


@dataclass(frozen=True)
class Evaluated:
    """One evaluation of a training."""

    step: int
    """Step of the training after which it was played."""
    result: Evaluation = field(repr=False)
    """Its run."""
    numbers: dict[str, float] = field(repr=False)
    """Rates, change with its interval, causes of lost pairs, and counts of pairs, by flat name."""

    def __str__(self) -> str:
        return f"step {self.step}: {_text_of(self)}"


class PairedEval:
    """Plays pairs every so many steps of a training, and logs Base, Dynamic, the change and the causes.

    Call it after each step; it evaluates where the number of steps is a multiple of ``every``::

        paired = PairedEval(policy, every=1000, track="smoke", stop="anytime:0.05", log=tracker.log)
        for step in range(1, 100_001):
            ...
            paired(step)

    Each evaluation is a run of its own, in the folder ``step-...`` of ``folder``. All of them play the same
    cases in the same order, so that later ones are compared with earlier ones case by case. The training goes
    on as if nothing had been played: see :func:`~pytest_libero_max.lab.training.paired_eval.undisturbed`. Of
    several processes of ``torch.distributed`` the first one plays.

    An error of an evaluation, such as a simulator that does not start or a disk that is full, is logged, and
    the training goes on; what was asked for wrongly is raised.

    Args:
        policy: As :func:`~pytest_libero_max.evaluate` takes it. The spec of an object has the step in its
            ``revision`` while it is played.
        every: Number of steps between two evaluations.
        track: Frozen set of cases.
        limit: Play a stratified, deterministic subset of so many cases; None for all.
        stop: Stopping rule of each evaluation; None plays all cases. ``anytime`` plays them in the order
            ``shuffled:0`` unless ``order`` names another seed.
        folder: Folder of the runs.
        model: PyTorch module that is put into evaluation mode meanwhile; None where the policy takes care.
        log: Called with the numbers and the step.
        exports: Trackers, as ``FORMAT=FOLDER``: ``tensorboard=logs``, ``wandb=...``, ``mlflow=...``.
        films: Number of regressions to film after each evaluation, for trackers and the page.
        settings: Other arguments of :func:`~pytest_libero_max.evaluate`.

    Attributes:
        history: The evaluations so far.
        model: The argument ``model``.

    Raises:
        OptionError: ``every`` or ``films`` is no such number, or a tracker is unknown.
    """

    def __init__(
        self,
        policy: str | Path | Policy | Callable[[], Policy],
        *,
        every: int,
        track: str | None = None,
        limit: int | None = None,
        stop: str | None = "anytime:0.05",
        folder: str | Path = "libero-max-training",
        model: Any = None,
        log: Log | None = None,
        exports: Iterable[str] = (),
        films: int = 0,
        **settings: Any,
    ) -> None:
        if isinstance(every, bool) or not isinstance(every, int) or every < 1:
            raise OptionError.seen("every", every, ", but must be a number of steps of at least 1.")
        if isinstance(films, bool) or not isinstance(films, int) or films < 0:
            raise OptionError.seen("films", films, ", but must be a number of films.")
        self.history: list[Evaluated] = []
        self.model = model
        self._policy, self._every, self._films, self._log = policy, every, films, log
        self._folder = Path(folder)
        self._exports = [_export_named(text) for text in exports]
        if stop is not None and stop.partition(":")[0] == "anytime":
            settings.setdefault("order", "shuffled:0")
        if films:
            settings.setdefault("traces", "regressions")
        self._settings = {"track": track, "limit": limit, "stop": stop, **settings}
        self._last: int | None = None

    def __call__(self, step: int) -> Evaluated | None:
        """Evaluate if this step is due, for the first time; None where it is not, or where it failed."""
        if step < 1 or step % self._every or step == self._last or not _is_first_process():
            return None
        self._last = step
        return self.evaluate(step)

    def attach(self, optimizer: Any, step: int = 0) -> Any:
        """Evaluate after the steps of a PyTorch optimizer, whoever calls it.

        Args:
            step: Number of steps that it has made before.

        Returns:
            The handle of the hook, whose ``remove()`` takes it off.
        """
        counted = step

        def after_step(*_: object) -> None:
            nonlocal counted
            counted += 1
            self(counted)

        return optimizer.register_step_post_hook(after_step)

    def evaluate(self, step: int) -> Evaluated | None:
        """Play the pairs now, whatever the step; None where that failed, which is logged.

        Raises:
            OptionError: The run cannot be played as asked for.
        """
        folder = self._folder / f"step-{step:08d}"
        try:
            with undisturbed(self.model), _named_by_step(self._policy, step):
                result = evaluate(self._policy, folder=folder, **self._settings)
                self._film(result)
                evaluated = self._logged(result, step)
        except OptionError:
            raise
        except LiberoMaxError:
            LOG.exception("step %s: there is no evaluation", step)
            return None
        self.history.append(evaluated)
        return evaluated

    def _film(self, result: Evaluation) -> None:
        """Film regressions, which needs no policy: what was executed is shown again."""
        from pytest_libero_max.cli import main
        from pytest_libero_max.report.broken import named_of

        lost = [pair for pair in result.report.changed_pairs if pair.outcome == "regression"]
        names = named_of(lost, self._films)[: self._films]
        if not names:
            return
        manifest = self._settings.get("manifest")
        cases = [] if manifest is None else [f"--cases={manifest}"]
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as told:
            status = main(["film", str(result.folder), *names, *cases])
        if status:
            LOG.warning("some regressions have no film: %s", told.getvalue().strip())

    def _logged(self, result: Evaluation, step: int) -> Evaluated:
        from pytest_libero_max.lab.exports.tracked import tracked_numbers

        evaluated = Evaluated(step, result, tracked_numbers(result.report))
        LOG.info(str(evaluated))
        if self._log is not None:
            self._log(evaluated.numbers, step)
        if self._exports:
            run = ExportedRun(result.folder, read_pairs(result.folder), result.gates, step)
            for name, place in self._exports:
                EXPORTS[name](run, place)
        return evaluated


def _text_of(evaluated: Evaluated) -> str:
    """Return an evaluation on one line: rates, change with its interval, causes, and its stop."""
    report, numbers = evaluated.result.report, evaluated.numbers
    if "base_success" not in numbers:
        return evaluated.result.summary  # incomplete: it has no score
    rates = f"Base {percent(numbers['base_success'])}, Dynamic {percent(numbers['dynamic_success'])}"
    if is_measurable(report.overall):
        change = f"change {points(numbers['paired_change'])} pp"
        if "paired_change_lower" in numbers:
            ends = (numbers["paired_change_lower"], numbers["paired_change_upper"])
            change += f" [{points(ends[0])}, {points(ends[1])}]"
    else:
        change = f"change not measurable ({'; '.join(lacks_of(report.overall))})"
    causes = {
        name.removeprefix("causes/"): count for name, count in numbers.items() if name.startswith("causes/")
    }
    ordered = sorted(causes.items(), key=lambda item: (-item[1], item[0]))
    lost = ", ".join(f"{count:.0f} x {cause}" for cause, count in ordered)
    parts = [f"{rates}, {change}", f"lost: {lost}" if lost else "", evaluated.result.reason.rstrip(".")]
    if report.pairs.stopped is not None:
        stopped = report.pairs.stopped
        parts.append(f"stopped at pair {stopped.at} of {stopped.of} by {stopped.rule}: {stopped.reason}")
    else:
        parts.append(counted(report.pairs.played, "pair"))
    return "; ".join(filter(None, parts))


@contextmanager
def _named_by_step(policy: Any, step: int) -> Iterator[None]:
    """Let the spec of a policy object say in the block which step of the training it is of."""
    spec = getattr(policy, "spec", None)
    if isinstance(policy, type) or not isinstance(spec, PolicySpec):
        yield
        return
    words = [spec.revision, f"step-{step}"]
    policy.spec = replace(spec, revision=" ".join(filter(None, words)))
    try:
        yield
    finally:
        policy.spec = spec


def _export_named(text: str) -> tuple[str, Path]:
    name, equals, place = text.partition("=")
    if not equals or not place:
        raise OptionError.seen("exports", text, ", but must be FORMAT=FOLDER, for example tensorboard=logs.")
    _ = EXPORTS[name]  # one that does not exist is refused before the training
    return name, Path(place)


def _is_first_process() -> bool:
    torch: Any = sys.modules.get("torch")
    if torch is None or not torch.distributed.is_available() or not torch.distributed.is_initialized():
        return True
    return bool(torch.distributed.get_rank() == 0)
