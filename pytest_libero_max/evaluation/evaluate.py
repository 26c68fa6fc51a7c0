"""A run from Python: the folder, records and numbers of a pytest session, without the session."""

from __future__ import annotations

import logging
import re
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from functools import partial
from html import escape
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import LiberoMaxError, OptionError, ReportError, class_name, did_you_mean
from pytest_libero_max.evaluation.keeper import RunKeeper, problem_text
from pytest_libero_max.evaluation.policy_source import GivenPolicy, PolicySource
from pytest_libero_max.evaluation.processes.pair_process import Playing
from pytest_libero_max.evaluation.processes.time_limits import Limits
from pytest_libero_max.evaluation.resolving import resolve
from pytest_libero_max.evaluation.run_cases import RunCases
from pytest_libero_max.evaluation.settings import DEFAULT_OUTPUT, GONE, OPTIONS, Settings
from pytest_libero_max.evaluation.stopping import Stop
from pytest_libero_max.evaluation.workers import CasePlayer, Job, Workers, for_workers, result_in
from pytest_libero_max.pairing.record import RECORD_PHASE, PairError, PairRecord
from pytest_libero_max.runs.damaged_lines import damage_said
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.progress import Pace, progress_text
from pytest_libero_max.runs.setting import Option
from pytest_libero_max.runs.status import ProgressNotes
from pytest_libero_max.runs.store import PairStore

if TYPE_CHECKING:
    from pytest_libero_max.policies.contract import Policy
    from pytest_libero_max.report.gates import GateResult
    from pytest_libero_max.report.report_document import Report

LOG = logging.getLogger("pytest_libero_max")
"""Tells the progress of a run, a line a minute and later fewer, and what went wrong beside its pairs."""

_FLAG = re.compile(r"--libero-max-([a-z]+(?:-[a-z]+)*)")
_ARGUMENTS = {"output": "folder", "gate": "gates", "resume": "resume=True"}
"""Arguments of :func:`evaluate` that have another name than the option."""


@dataclass(frozen=True)
class Evaluation:
    """Result of :func:`evaluate`."""

    folder: Path
    """Folder of the run, with ``pairs.jsonl``, ``report.json``, ``report.md`` and ``report.html``."""
    report: Report
    """Content of ``report.json``; its numbers are computed from ``pairs.jsonl`` alone."""
    gates: tuple[GateResult, ...]
    """Verdict on each gate, in their order."""
    status: int
    """0; 10 where a gate does not hold, 11 where the run is incomplete: the exit status of pytest."""
    reason: str
    """Why the status is not 0; empty where it is."""

    @property
    def passed(self) -> bool:
        """True for a complete run whose gates hold."""
        return self.status == 0

    @property
    def numbers(self) -> dict[str, float]:
        """The main numbers under flat names, for experiment trackers."""
        from pytest_libero_max.report.run_tables import main_numbers

        return main_numbers(self.report)

    @property
    def summary(self) -> str:
        """The result on one line."""
        from pytest_libero_max.report.writers.summary import quiet_lines

        return "; ".join(filter(None, [*quiet_lines(self.report)[:1], self.reason]))

    def __str__(self) -> str:
        return self.summary

    def _repr_html_(self) -> str:
        page = (self.folder / "report.html").absolute().as_uri()
        return f'<p>{escape(self.summary)} <a href="{escape(page)}">Report</a></p>'


def evaluate(
    policy: str | Path | Policy | Callable[[], Policy],
    *,
    track: str | None = None,
    limit: int | None = None,
    workers: int = 1,
    folder: str | Path = DEFAULT_OUTPUT,
    resume: bool = False,
    gates: Iterable[str] = (),
    **settings: Any,
) -> Evaluation:
    """Play the pairs of a track with a policy, and report them.

    Folder, records, lock, provenance and report are those of ``pytest --libero-max-policy=...``, and the
    same cases give the same records and numbers. Nothing is printed; the logger ``pytest_libero_max`` tells
    the progress. ``KeyboardInterrupt`` leaves a run that ``resume=True`` continues.

    A policy object is played in this process and stays open. Its records name it, and not its code: say
    which weights it has with ``PolicySpec(revision=...)``. What a run loads or makes itself it closes.

    Args:
        policy: A policy; a class or function without arguments that returns one; or what
            ``--libero-max-policy`` takes: a name, a file, ``MODULE:NAME``, the address of a server.
        track: Frozen set of cases; None for ``smoke``.
        limit: Play a stratified, deterministic subset of so many cases; None for all.
        workers: 1: play in this process. More: so many processes, each with a policy of its own, which is
            then no object but something that they can load. A script that uses them keeps what it does
            under ``if __name__ == "__main__":``.
        folder: Output folder. An earlier run in it is set aside.
        resume: Continue the run in the folder: what it has measured is not played again.
        gates: Conditions on the report, for example ``"dynamic_sr >= 0.6"``, which the result decides.
        settings: Any other option of pytest's command line that is about a run, under its name with
            underscores: ``horizon``, ``query_interval``, ``profile``, ``revision``, ``manifest``,
            ``program``, ``substrate``, ``order``, ``stop``, ``strength``, ``latency``, ``study``,
            ``traces``, ``timeout``, ``retries``, ... Values are as there, or Python's own. Limits of
            time and memory need processes of their own, which are then started for one worker as well.

    Returns:
        The result. A policy that fails is a result, and so is an incomplete run.

    Raises:
        LiberoMaxError: The run cannot be played as asked for, or what it measured cannot be stored.
    """
    for name, own in _OWN.items():
        if name in settings:
            raise OptionError(f"evaluate() has no argument {name!r}. It is spelled {own}.")
    asked = {"policy": policy, "track": track, "limit": limit, "resume": resume, **settings}
    with _named_as_arguments():
        source = _source({**asked, "output": folder, "gate": tuple(gates)})
        return _Run(source, workers).play()


_OWN = {"output": "folder", "gate": "gates"}
"""Arguments that have another name than their option."""


class _Run:
    """A run of one call of :func:`evaluate`."""

    def __init__(self, source: PolicySource, workers: int) -> None:
        if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
            raise OptionError.seen("workers", workers, ", but must be an integer of at least 1.")
        settings = self._settings = source.settings
        self._source, self._workers = source, workers
        limited = settings.timeout != Limits() or settings.memory
        self._apart = workers > 1 or bool(limited)
        if self._apart:
            Job(source, 0.0, workers).require_sendable()
        self._cases, stop = RunCases(settings), Stop(settings)
        self._progress = _Progress(self._cases)
        self._keeper = RunKeeper(
            settings, self._cases, source, stop, Path.cwd(), on_stored=self._progress.stored
        )

    def play(self) -> Evaluation:
        """Play the pairs and report them."""
        keeper = self._keeper
        if self._settings.resume:
            keeper.read_before()
            for line in damage_said(() if keeper.before is None else keeper.before.damaged):
                LOG.warning(line)
        begun_s = keeper.begun_s
        if (remark := keeper.check_folder()) is not None:
            LOG.info(remark)
        planned = [*keeper.cases.values()]
        selection = keeper.selection(planned, self._cases.asked)
        settled = keeper.plan(planned, selection, sys.argv, Path.cwd())
        assert keeper.store is not None
        try:
            self._progress.begin(keeper.store, settled)
            names = [name for name in keeper.cases if name not in keeper.settled]
            job = Job(for_workers(self._source), begun_s, self._workers)
            if self._apart:
                self._play_in_workers(job, names)
            else:
                self._play_here(job, names)
        except BaseException:
            keeper.store.close()  # the pairs are kept, and the run can be resumed
            raise
        return self._result()

    def _play_here(self, job: Job, names: Iterable[str]) -> None:
        from pytest_libero_max.worlds.threads import one_blas_thread

        keeper = self._keeper
        with ExitStack() as stack:
            stack.enter_context(one_blas_thread())
            player = stack.enter_context(closing(CasePlayer(job, self._cases.with_second_base, Playing())))
            for name in names:
                if keeper.stop.stopped is not None:
                    break
                self._progress.began(name)
                self._receive(name, player.play(keeper.cases[name]))

    def _play_in_workers(self, job: Job, names: Iterable[str]) -> None:
        pool = Workers(job, self._keeper, self._receive, self._progress.began)
        self._progress.also = pool.deaths.stored
        pool.play(names)

    def _receive(self, name: str, answer: Json) -> None:
        """Store what became of a pair."""
        keeper = self._keeper
        try:
            result = result_in(answer)
        except ReportError as error:
            result = PairError.of(keeper.cases[name], error, RECORD_PHASE)
        if result is None:
            keeper.stop.stored(name, None)
            return
        if answer.get("note"):
            LOG.warning("beside the pair, which is measured: %s", answer["note"])
        keeper.add(keeper.checked(result), answer.get("stop"))

    def _result(self) -> Evaluation:
        keeper = self._keeper
        keeper.end()
        try:
            keeper.write()
        except Exception as error:
            keeper.problems.append(f"There is no report: {problem_text(error)}")
        for problem in keeper.problems:
            LOG.error(problem)
        if keeper.report is None:
            raise ReportError(" ".join(dict.fromkeys(keeper.problems)))
        status, reason = keeper.ending() or (0, "")
        result = Evaluation(self._settings.output, keeper.report, keeper.verdicts, status, _in_python(reason))
        LOG.info(result.summary)
        return result


class _Progress:
    """Progress of a run in the log, and as a note in its folder."""

    def __init__(self, cases: RunCases) -> None:
        self._cases, self._notes, self._pace = cases, ProgressNotes(), Pace(time.monotonic())
        self.began = self._notes.play
        self.also: Callable[[PairRecord | PairError], None] = lambda pair: None
        """Called with each stored pair as well."""

    def begin(self, store: PairStore, settled: Sequence[PairRecord | PairError]) -> None:
        """Begin to tell."""
        self._notes.begin(store, [PlannedPair.of(case) for case in self._cases.chosen], settled)
        LOG.info("%s pairs, %s settled before, into %s", len(self._cases.chosen), len(settled), store.path)

    def stored(self, pair: PairRecord | PairError) -> None:
        """Count a stored pair."""
        self.also(pair)
        self._notes.stored(pair)
        if isinstance(pair, PairError):
            LOG.warning("%s was not measured: %s: %s", pair.item_id, pair.kind, pair.message)
        if self._pace.due(time.monotonic()):
            LOG.info(progress_text(self._notes.progress, time.time()))


def _source(asked: dict[str, Any]) -> PolicySource:
    """Return the source of the policy with the settings of the run."""
    policy = asked["policy"]
    named = policy if isinstance(policy, str | Path) else _reference(policy)
    settings = _settings({**asked, "policy": named or _name_of(policy)})
    return PolicySource(settings) if named is not None else GivenPolicy(settings, policy)


def _settings(asked: dict[str, Any]) -> Settings:
    """Return settings from arguments."""
    options = {option.field: option for option in OPTIONS if not option.session}
    for name in asked:
        if name not in options:
            raise OptionError(f"evaluate() has no argument {name!r}. {_instead(name, options)}")
    given = {name for name, value in asked.items() if value is not None and value is not False}
    values = {
        option.field: _value(option, asked[option.field]) if option.field in given else option.default
        for option in OPTIONS
    }
    return resolve(values, Path.cwd(), given)


def _instead(name: str, known: Collection[str]) -> str:
    """Return what to write in the place of an argument that there is not."""
    word = name.replace("_", "-")
    session = {option.name for option in OPTIONS if option.session}
    spelled = GONE.get(word, word if word in session else None)
    if spelled is None:
        return did_you_mean(name, sorted({*known, *_OWN.values()} - {*_OWN}))
    if spelled.partition("=")[0].replace("-", "_") in known:
        return f"It is spelled {spelled}."
    return f"Only a session of pytest has it, as --libero-max-{spelled}."


def _value(option: Option, value: Any) -> Any:
    if option.switch:
        return bool(value)
    where = _in_python(option.flag)
    if option.many:
        texts = [value] if isinstance(value, str | Path) else value
        return tuple(option.read(str(text), where) for text in texts)
    if isinstance(value, Mapping):
        value = [f"{name}:{setting}" for name, setting in value.items()]
    return option.read(",".join(map(str, value)) if isinstance(value, list | tuple) else str(value), where)


def _reference(thing: Any) -> str | None:
    """Return the reference of a class or function at the top of a module that any process can import."""
    if not isinstance(thing, type | FunctionType) or "." in thing.__qualname__:
        return None
    name, module = thing.__qualname__, thing.__module__
    if module == "__main__" or getattr(sys.modules.get(module), name, None) is not thing:
        return None
    try:
        imported = getattr(import_module(module), name, None)
    except ImportError:
        return None
    return f"{module}:{name}" if imported is thing else None


def _name_of(policy: Any) -> str:
    """Return the name of a policy object, or of what makes one, for provenance and messages."""
    spec = getattr(policy, "spec", None)
    named = policy.func if isinstance(policy, partial) else policy
    return str(getattr(spec, "name", None) or getattr(named, "__qualname__", None) or class_name(policy))


def _in_python(text: str) -> str:
    """Return a message with the arguments of :func:`evaluate` in the place of options."""

    def argument(flag: re.Match[str]) -> str:
        name = flag[1].replace("-", "_")
        return _ARGUMENTS.get(name, name)

    return _FLAG.sub(argument, text)


@contextmanager
def _named_as_arguments() -> Iterator[None]:
    """Let messages of errors in the block name arguments, not options."""
    try:
        yield
    except LiberoMaxError as error:
        error.args = (_in_python(str(error)), *error.args[1:])
        raise
