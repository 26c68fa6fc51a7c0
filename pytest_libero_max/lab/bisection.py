"""Search for the first of several revisions that loses what an earlier one completes.

The cases that the bad end loses are found first. Each revision between the ends then plays these cases alone,
in a random order, until the rule ``anytime`` has decided :data:`GATE`. The number of them that a revision
completes is fixed, and the order alone is random: the level of the rule assumes nothing about the policy.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

from pytest_libero_max.benchmark.documents import canonical_digest, slug
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.exit_status import GATE_FAILED
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.gates import parse_gates
from pytest_libero_max.report.render.terminal import aligned
from pytest_libero_max.runs.outside import cases_of_run
from pytest_libero_max.runs.plan import unsupported_pairs
from pytest_libero_max.runs.store import StoredRun, read_pairs
from pytest_libero_max.stats.sequential import log_evidence_of_change

VARIABLE = "LIBERO_MAX_CHECKPOINT"
"""Environment variable that holds the checkpoint, or the commit, that is played."""

PLACE = "{}"
"""Stands for the checkpoint in the arguments of pytest."""

_OURS = ("output", "resume", "order", "stop", "gate", "shard")
"""Options that each run is given by the command."""

GATE = "dynamic_sr > 50%"
"""Holds of a good revision, on the cases that the bad end loses."""

Verdict = Literal["good", "bad", "cannot be played"]


@dataclass(frozen=True)
class Lost:
    """Cases that one run completes in Dynamic and another one does not."""

    case_ids: tuple[str, ...]
    """Their ids, sorted."""
    gains: int
    """Number of cases of which it is the other way round."""
    pairs: int
    """Number of cases that both have measured."""

    @classmethod
    def between(cls, good: StoredRun, bad: StoredRun) -> Lost:
        """Compare two runs on the cases that both have measured."""
        before = {record.case_id: record.dynamic_success for record in good.records}
        now = {record.case_id: record.dynamic_success for record in bad.records if record.case_id in before}
        lost = sorted(case_id for case_id, success in now.items() if before[case_id] and not success)
        gains = sum(success and not before[case_id] for case_id, success in now.items())
        return cls(tuple(lost), gains, len(now))

    @property
    def p_value(self) -> float:
        """Of the sequential McNemar test, valid however often it was looked at; at most 1."""
        return min(1.0, math.exp(-log_evidence_of_change(len(self.case_ids), self.gains)))

    def shown(self, level: float) -> bool:
        """Return True if the bad run is shown to lose more than it gains."""
        return len(self.case_ids) > self.gains and self.p_value <= level


class Result(NamedTuple):
    """Result of a revision: the pairs that it has played, and the lost cases among them."""

    name: str
    pairs: int
    verdict: Verdict
    completed: int = 0
    """Number of the lost cases that it completes in Dynamic."""
    of: int = 0
    """Number of the lost cases that it has played."""
    note: str = ""
    """For people, for example the subject of a commit."""


def has_ended(stored: StoredRun, *, by_rule: bool) -> bool:
    """Return True if a run is whole or, with ``by_rule``, if its stopping rule has ended it."""
    if by_rule and stored.stopped is not None and stored.stopped.rule is not None:
        return not (({error.case_id for error in stored.errors}) - stored.measured)
    policy = stored.records[0].policy if stored.records else None
    left_out = {pair.case_id for pair in unsupported_pairs(stored.run.planned, policy)}
    return (
        bool(stored.records) and {pair.case_id for pair in stored.run.planned} - left_out == stored.measured
    )


def completed(stored: StoredRun, case_ids: Sequence[str]) -> dict[str, bool]:
    """Return Dynamic success of the cases, among some, that a run has measured."""
    wanted = set(case_ids)
    return {record.case_id: record.dynamic_success for record in stored.records if record.case_id in wanted}


def verdict_of(stored: StoredRun) -> Verdict:
    """Return the verdict on a revision that has played lost cases, all or until its rule stopped it."""
    if stored.stopped is not None:
        report = build_report(
            stored.records, stored.errors, stored.run.planned, stored.run.provenance, stored.stopped
        )
        known = report.pairs.stopped.watched if report.pairs.stopped else []
        (verdict,) = (one.verdict for one in known if one.what == parse_gates([GATE])[0].text)
        return "good" if verdict == "passed" else "bad"
    solved = sum(record.dynamic_success for record in stored.records)
    return "good" if 2 * solved > len(stored.records) else "bad"


def first_bad(count: int, judge: Callable[[int], Verdict]) -> tuple[int, int]:
    """Bisect revisions of which the first is good and the last is bad.

    Where a revision cannot be played, the nearest one to the middle that was not tried is next.

    Args:
        count: Number of revisions, at least 2.
        judge: Returns the verdict on a revision by its number, from 0.

    Returns:
        The last good and the first bad one. Those between them cannot be played.
    """
    low, high, tried = 0, count - 1, set[int]()
    while left := [number for number in range(low + 1, high) if number not in tried]:
        number = min(left, key=lambda number: (abs(2 * number - low - high), number))
        verdict = judge(number)
        tried.add(number)
        if verdict == "good":
            low = number
        elif verdict == "bad":
            high = number
    return low, high


# The command.


@dataclass(frozen=True)
class Revision:
    """A git commit or a checkpoint, the folder of its run, and the subject of a commit."""

    name: str
    folder: str
    note: str = ""
    commit: bool = False

    @property
    def short(self) -> str:
        """Its name for people."""
        return self.name[:12] if self.commit else self.name


def bisect(options: argparse.Namespace) -> int:
    """Bisect as the command asks for; return its exit status."""
    if not 0 < options.level <= 0.5:
        raise OptionError.seen("--level", options.level, ", but must be above 0 and at most 0.5.")
    revisions = _checkpoints(options) if options.checkpoints else _commits(options.good, options.bad)
    runs = Runs(options, revisions)
    runs.begin()
    good = runs.end(revisions[0], options.good_run, None)
    good_folder = options.good_run or runs.folder(revisions[0])
    rule = f"worse_than:{options.level:g},{Path(good_folder).absolute()}"
    bad = runs.end(revisions[-1], options.bad_run, rule)
    lost = Lost.between(good, bad)
    counts = f"{len(lost.case_ids)} lost and {lost.gains} gained of {counted(lost.pairs, 'pair')}"
    counts += f", p = {lost.p_value:.2g}"
    # Pairs that were in flight when the rule decided are counted here as well.
    if bad.stopped is None and not lost.shown(options.level):
        say(
            [
                f"Not shown at level {options.level:g} that {revisions[-1].short} is worse than "
                f"{revisions[0].short}: {counts}.",
                "Play more cases, or give a larger --level where you know that the losses are real.",
            ]
        )
        return GATE_FAILED
    say([f"{revisions[-1].short} is worse than {revisions[0].short}: {counts}."])
    cases = runs.write_cases(good, lost)
    stop = [f"--libero-max-stop=anytime:{options.level:g}", f"--libero-max-gate={GATE}"]
    verdicts: dict[int, Verdict] = {0: "good", len(revisions) - 1: "bad"}

    def judge(number: int) -> Verdict:
        stored = runs.play(revisions[number], [*stop, *cases], by_rule=True)
        verdicts[number] = "cannot be played" if stored is None else verdict_of(stored)
        say([f"{revisions[number].short}: {verdicts[number]}"])
        return verdicts[number]

    low, high = first_bad(len(revisions), judge)
    ends = {0: good, len(revisions) - 1: bad}
    for number in sorted({low, high} - ends.keys()):
        # The rule knew the majority. Which cases a revision loses takes all of them.
        stored = runs.play(revisions[number], ["--override-ini=libero_max_gate=", *cases], by_rule=False)
        if stored is None:
            raise OptionError(runs.trouble(revisions[number]))
        ends[number] = stored
    results = [
        _result(runs, revisions[number], ends.get(number), verdicts[number], lost)
        for number in sorted(verdicts)
    ]
    say(_outcome(revisions, results, low, high, ends, lost))
    return 0


def _result(runs: Runs, revision: Revision, stored: StoredRun | None, verdict: Verdict, lost: Lost) -> Result:
    stored = stored or runs.stored(revision)
    outcomes = {} if stored is None else completed(stored, lost.case_ids)
    pairs = 0 if stored is None else len(stored.records)
    return Result(revision.short, pairs, verdict, sum(outcomes.values()), len(outcomes), revision.note)


def _outcome(
    revisions: Sequence[Revision],
    results: Sequence[Result],
    low: int,
    high: int,
    ends: dict[int, StoredRun],
    lost: Lost,
) -> Iterator[str]:
    yield ""
    rows = [("revision", "pairs", "lost cases completed", "verdict", "")]
    for result in results:
        share = f"{result.completed} of {result.of}" if result.of else ""
        rows.append((result.name, str(result.pairs), share, result.verdict, result.note))
    yield from aligned(rows)
    whole = len(revisions) * len(ends[0].records)
    yield (
        f"{len(results)} of {counted(len(revisions), 'revision')} played, "
        f"{counted(sum(result.pairs for result in results), 'pair')}; all of them on all cases are {whole}."
    )
    yield ""
    before, after = (completed(ends[number], lost.case_ids) for number in (low, high))
    broken = [case_id for case_id in lost.case_ids if before[case_id] and not after[case_id]]
    between = [revision.short for revision in revisions[low + 1 : high]]
    if between:
        yield (
            f"The first bad revision is {revisions[high].short} or one of those before it that cannot be "
            f"played: {', '.join(between)}."
        )
    else:
        yield " ".join(["First bad revision:", revisions[high].name, revisions[high].note]).rstrip() + "."
    yield f"It loses {len(broken)} of the {counted(len(lost.case_ids), 'lost case')}:"
    names = {pair.case_id: pair.item_id for pair in ends[high].run.planned}
    yield from (f"  {names[case_id]}" for case_id in broken)
    earlier = sum(not success for success in before.values())
    later = sum(after.values())
    next_step = "With another --output, bisect with"
    if earlier:
        yield f"Lost before it: {counted(earlier, 'other case')}. {next_step} --bad {revisions[low].short}."
    if later:
        yield f"Lost after it: {counted(later, 'other case')}. {next_step} --good {revisions[high].short}."


def _checkpoints(options: argparse.Namespace) -> list[Revision]:
    names: list[str] = options.checkpoints
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise OptionError(f"--checkpoints: {repeated[0]!r} is named twice. Name each once, in their order.")
    if len(names) < 2 or options.good or options.bad:
        raise OptionError(
            "--checkpoints: name two or more, the good one first, and leave --good and --bad out."
        )
    return [Revision(name, f"{slug(name)[-40:]}-{canonical_digest(name)[:8]}") for name in names]


def _commits(good: str | None, bad: str | None) -> list[Revision]:
    """Return the good commit and those after it up to the bad one, along first parents."""
    if not good or not bad:
        raise OptionError("bisect needs --good REV and --bad REV, or --checkpoints.")
    first, last = (_git("rev-parse", "--verify", "--end-of-options", f"{name}^0") for name in (good, bad))
    listed = _git("log", "--reverse", "--first-parent", "--format=%H %s", f"{first}..{last}").splitlines()
    if not listed or _git("merge-base", first, last) != first:
        raise OptionError(
            f"--good={good!r} is no ancestor of --bad={bad!r}. Name two revisions of one line of "
            "development, the good one first."
        )
    rows = (line.partition(" ") for line in (_git("log", "-1", "--format=%H %s", first), *listed))
    return [Revision(name, name[:12], subject, commit=True) for name, _, subject in rows]


def _git(*words: str) -> str:
    try:
        done = subprocess.run(["git", *words], capture_output=True, text=True, check=False)
    except OSError as error:
        raise OptionError(f"Cannot run git: {error}. Install it, or give --checkpoints.") from error
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise OptionError(f"git {words[0]}: {reason}. Give the command in the adapter's repository.")
    return done.stdout.strip()


@dataclass
class Runs:
    """The runs of a bisection: each in a folder of its own, played by pytest in a process of its own."""

    options: argparse.Namespace
    revisions: Sequence[Revision]

    def __post_init__(self) -> None:
        self._output: Path = self.options.output.absolute()
        self._arguments, self._cases = _split(self.options.arguments)
        if self.revisions[0].commit:
            self._top = Path(_git("rev-parse", "--show-toplevel"))
            policy = next(iter(self._arguments), "")
            if Path(policy.removeprefix("--libero-max-policy=")).is_absolute():
                raise OptionError(
                    f"{policy} is the same file in every revision. Go to its repository, and name it from "
                    "there."
                )

    def begin(self) -> None:
        """Note what is bisected, or check that this is what the folder was begun with."""
        settings = {
            "format": 1,
            "revisions": [revision.name for revision in self.revisions],
            "arguments": [*self._arguments, *self._cases],
            "level": self.options.level,
            "seed": self.options.seed,
        }
        path = self._output / "bisect.json"
        try:
            if path.exists():
                there = json.loads(path.read_text(encoding="utf-8"))
                different = [name for name in settings if there.get(name) != settings[name]]
                if different:
                    raise OptionError(
                        f"{self._output} was begun with other {' and '.join(different)}: {path} has them. "
                        "Give the same command again, or another --output."
                    )
                return
            self._output.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(settings, indent=1) + "\n", encoding="utf-8")
        except (OSError, ValueError, AttributeError) as error:
            raise OptionError(f"{path}: {error}. Give another --output.") from error

    def folder(self, revision: Revision) -> Path:
        return self._output / revision.folder

    def log(self, revision: Revision) -> Path:
        return self._output / f"{revision.folder}.log"

    def stored(self, revision: Revision) -> StoredRun | None:
        with suppress(ReportError):
            return read_pairs(self.folder(revision))
        return None

    def end(self, revision: Revision, given: Path | None, rule: str | None) -> StoredRun:
        """Return the run of the good or the bad end, which is played unless one is given."""
        if given is not None:
            return read_pairs(given)
        flags = [*self._cases, "--override-ini=libero_max_gate="]
        flags += [] if rule is None else [f"--libero-max-stop={rule}"]
        stored = self.play(revision, flags, by_rule=rule is not None)
        if stored is None:
            raise OptionError(self.trouble(revision))
        return stored

    def trouble(self, revision: Revision) -> str:
        """Return an error about a revision that has to be played and cannot be."""
        lines = self.log(revision).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        end = f" It ends with: {lines[-1]}" if lines else ""
        return f"{revision.short} cannot be played; {self.log(revision)} has what pytest printed.{end}"

    def play(self, revision: Revision, flags: Sequence[str], *, by_rule: bool) -> StoredRun | None:
        """Play a revision unless its run has ended already; None where it cannot be played.

        Args:
            flags: Arguments of pytest: the cases, and what stops the run.
            by_rule: True if a run that its stopping rule has ended will do.
        """
        stored = self.stored(revision)
        if stored is not None and has_ended(stored, by_rule=by_rule):
            return stored
        print(f"playing {revision.short} {revision.note}".rstrip(), file=sys.stderr, flush=True)
        words = [
            *(sys.executable, "-m", "pytest"),
            *(
                word.replace(PLACE, revision.name) if not revision.commit else word
                for word in self._arguments
            ),
            *flags,
            f"--libero-max-order=shuffled:{self.options.seed}",
            f"--libero-max-output={self.folder(revision)}",
            "--libero-max-resume",
        ]
        with self._place(revision) as place, self.log(revision).open("w", encoding="utf-8") as log:
            environment = {**os.environ, VARIABLE: revision.name}
            status = 0
            for command in (self.options.before, words):
                if command and status == 0:
                    shell = isinstance(command, str)
                    status = subprocess.run(
                        command, cwd=place, env=environment, stdout=log, stderr=log, shell=shell, check=False
                    ).returncode
        stored = self.stored(revision)
        return stored if stored is not None and has_ended(stored, by_rule=by_rule) else None

    @contextmanager
    def _place(self, revision: Revision) -> Iterator[Path]:
        """Folder to play in: the current one, or for a commit the same one in a checkout of its own."""
        if not revision.commit:
            yield Path.cwd()
            return
        # A tree for each commit: Python would take files of the same size and second for the same.
        tree = self._output / "trees" / revision.folder
        remove = ("worktree", "remove", "--force", str(tree))
        if tree.exists():  # left by a command that was killed
            _git(*remove)
        _git("worktree", "add", "--quiet", "--force", "--detach", str(tree), revision.name)
        try:
            yield tree / Path.cwd().relative_to(self._top)
        finally:
            _git(*remove)

    def write_cases(self, good: StoredRun, lost: Lost) -> list[str]:
        """Write the lost cases as a manifest, and return the arguments that play it."""
        name = self._cases[0].partition("=")[2] if self._cases else None
        whole = cases_of_run(good.run.provenance, name, "--libero-max-manifest")
        cases = tuple(case for case in whole if case.case_id in set(lost.case_ids))
        path = self._output / "lost.json"
        path.write_text(
            Manifest(f"lost-{whole.benchmark_id}", whole.version, whole.protocol, cases).to_json()
        )
        return [f"--libero-max-manifest={path}"]


def _split(words: Sequence[str]) -> tuple[list[str], list[str]]:
    reader = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    for name in ("policy", "track", "manifest", *_OURS):
        reader.add_argument(f"--libero-max-{name}", dest=name, nargs="?", const="")
    words = [f"--libero-max-policy={words[0]}", *words[1:]] if not words[0].startswith("-") else [*words]
    known, others = reader.parse_known_args(words)
    for name in _OURS:
        if getattr(known, name) is not None:
            raise OptionError(f"--libero-max-{name}: bisect gives that to each run itself. Take it away.")
    cases = [] if known.track is None else [f"--libero-max-track={known.track}"]
    if known.manifest is not None:
        cases = [f"--libero-max-manifest={Path(known.manifest).absolute()}"]
    policy = [] if known.policy is None else [f"--libero-max-policy={known.policy}"]
    return [*policy, *others], cases
