"""``libero-max lab bisect``: the revision or checkpoint that broke cases, found with few pairs."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.documents import canonical_digest, slug
from pytest_libero_max.cli.arguments import Commands, option, whole_number
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError, ReportError

if TYPE_CHECKING:
    from pytest_libero_max.lab.bisection import Looked, Lost, Verdict
    from pytest_libero_max.runs.store import StoredRun

VARIABLE = "LIBERO_MAX_CHECKPOINT"
"""Environment variable that holds the checkpoint, or the commit, that is played."""

PLACE = "{}"
"""Stands for the checkpoint in the arguments of pytest."""

_OURS = ("output", "resume", "order", "stop", "gate", "shard")
"""Options that each run is given by this command."""


def add_command(commands: Commands) -> None:
    """Add ``bisect`` to the parser."""
    bisect = commands.add_parser(
        "bisect",
        help="Find the revision or checkpoint that lost cases, with as few pairs as a sequential test needs",
        description="For example: libero-max lab bisect --good v1 --bad HEAD -- adapter.py "
        "--libero-max-track=lite. Plays the good revision on all cases, the bad one until it is shown to "
        "lose more than it gains, and then revisions between them on the lost cases alone, until it is shown "
        "whether they complete more than half of them. Each revision of the repository around the current "
        "folder is checked out apart, along first parents. Each run is an ordinary one in a folder of its "
        "own, and the same command goes on where it stopped. Exit status 10 where no loss is shown.",
    )
    option(bisect, "--good REV", "Revision, or checkpoint, that completes the cases")
    option(bisect, "--bad REV", "Later one that loses them")
    option(
        bisect,
        "--checkpoints NAME",
        f"Bisect these, in their order, instead of git revisions: {PLACE} in an argument stands for the "
        f"name, and so does the environment variable {VARIABLE} (--good and --bad: the first and the last)",
        nargs="+",
    )
    for end in ("good", "bad"):
        option(
            bisect,
            f"--{end}-run RUN",
            f"Folder of an earlier run of the {end} one on the same cases, which is then not played",
            type=Path,
        )
    option(bisect, "--before COMMAND", "A line of shell, run in each checked out revision before it plays")
    option(bisect, "--level P", "Of each test", type=float, default=0.05)
    option(bisect, "--seed N", "Of the order of play", type=whole_number(0), default=1)
    option(
        bisect,
        "--output FOLDER",
        "For the runs, one folder each",
        type=Path,
        default=Path("libero-max-bisect"),
    )
    bisect.add_argument(
        "arguments",
        nargs="+",
        metavar="POLICY|ARGUMENT",
        help="The policy and other arguments of pytest, after --",
    )
    bisect.set_defaults(run=_bisect)


@dataclass(frozen=True)
class Revision:
    """A git revision or a checkpoint.

    Attributes:
        name: Commit, or name of the checkpoint.
        folder: Name of the folder of its run.
        note: Subject of the commit; empty for a checkpoint.
        commit: True for a commit.
    """

    name: str
    folder: str
    note: str = ""
    commit: bool = False

    @property
    def short(self) -> str:
        """Its name for people."""
        return self.name[:12] if self.commit else self.name


def _bisect(options: argparse.Namespace) -> int:
    from pytest_libero_max.lab.bisection import GATE, Lost, first_bad, verdict_of
    from pytest_libero_max.report.exit_status import GATE_FAILED
    from pytest_libero_max.report.formats import counted

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
        found = runs.play(revisions[number], [*stop, *cases], by_rule=True)
        verdicts[number] = "cannot be played" if found is None else verdict_of(found)
        say([f"{revisions[number].short}: {verdicts[number]}"])
        return verdicts[number]

    low, high = first_bad(len(revisions), judge)
    ends = {0: good, len(revisions) - 1: bad}
    for number in sorted({low, high} - ends.keys()):
        # The rule knew the majority. Which cases a revision loses takes all of them.
        found = runs.play(revisions[number], ["--override-ini=libero_max_gate=", *cases], by_rule=False)
        if found is None:
            raise OptionError(runs.trouble(revisions[number]))
        ends[number] = found
    looked = [
        _looked(runs, revisions[number], ends.get(number), verdicts[number], lost)
        for number in sorted(verdicts)
    ]
    say(_outcome(revisions, looked, low, high, ends, lost))
    return 0


def _looked(runs: Runs, revision: Revision, stored: StoredRun | None, verdict: Verdict, lost: Lost) -> Looked:
    from pytest_libero_max.lab.bisection import Looked, completed

    stored = stored or runs.stored(revision)
    found = {} if stored is None else completed(stored, lost.case_ids)
    pairs = 0 if stored is None else len(stored.records)
    return Looked(revision.short, pairs, verdict, sum(found.values()), len(found), revision.note)


def _outcome(
    revisions: Sequence[Revision],
    looked: Sequence[Looked],
    low: int,
    high: int,
    ends: dict[int, StoredRun],
    lost: Lost,
) -> Iterator[str]:
    from pytest_libero_max.lab.bisection import completed, table
    from pytest_libero_max.report.formats import counted

    yield ""
    yield from table(looked)
    whole = len(revisions) * len(ends[0].records)
    yield (
        f"{len(looked)} of {counted(len(revisions), 'revision')} played, "
        f"{counted(sum(one.pairs for one in looked), 'pair')}; all of them on all cases are {whole}."
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
    ends = [options.good or names[0], options.bad or names[-1]]
    for flag, name in zip(("--good", "--bad"), ends, strict=True):
        if name not in names:
            raise OptionError.seen(flag, name, f" is none of the checkpoints {', '.join(names)}.")
    first, last = map(names.index, ends)
    if first >= last:
        raise OptionError(f"--good={ends[0]!r} must come before --bad={ends[1]!r} among the checkpoints.")
    return [
        Revision(name, f"{slug(name)[-40:]}-{canonical_digest(name)[:8]}") for name in names[first : last + 1]
    ]


def _commits(good: str | None, bad: str | None) -> list[Revision]:
    """Return the good commit and those after it up to the bad one, along first parents."""
    if not good or not bad:
        raise OptionError("bisect needs --good REV and --bad REV, or --checkpoints.")
    first, last = (
        _git("rev-parse", "--verify", "--end-of-options", f"{name}^{{commit}}") for name in (good, bad)
    )
    listed = _git("log", "--reverse", "--first-parent", "--format=%H %s", f"{first}..{last}").splitlines()
    if not listed or _git("merge-base", first, last) != first:
        raise OptionError(
            f"--good={good!r} is no ancestor of --bad={bad!r}. Name two revisions of one line of "
            "development, the good one first."
        )
    subject = _git("log", "-1", "--format=%s", first)
    rows = [(first, subject), *(tuple(line.split(" ", 1)) for line in listed)]
    return [Revision(row[0], row[0][:12], row[1] if len(row) > 1 else "", commit=True) for row in rows]


def _git(*words: str) -> str:
    try:
        done = subprocess.run(["git", *words], capture_output=True, text=True, check=False)
    except OSError as error:
        raise OptionError(f"Cannot run git: {error}. Install it, or give --checkpoints.") from error
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise OptionError(f"git {words[0]}: {said}. Give the command in the adapter's repository.")
    return done.stdout.strip()


@dataclass
class Runs:
    """The runs of a bisection: each in a folder of its own, played by pytest in a process of its own.

    Attributes:
        revisions: From the good to the bad one.
    """

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
        """Note what is bisected, or check that this is what the folder was begun with.

        Raises:
            OptionError: It is something else, or the folder cannot be written.
        """
        wanted = {
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
                different = [name for name in wanted if there.get(name) != wanted[name]]
                if different:
                    raise OptionError(
                        f"{self._output} was begun with other {' and '.join(different)}: {path} has them. "
                        "Give the same command again, or another --output."
                    )
                return
            self._output.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(wanted, indent=1) + "\n", encoding="utf-8")
        except (OSError, ValueError, AttributeError) as error:
            raise OptionError(f"{path}: {error}. Give another --output.") from error

    def folder(self, revision: Revision) -> Path:
        """Folder of the run of a revision."""
        return self._output / revision.folder

    def log(self, revision: Revision) -> Path:
        """Return the path of what pytest printed for a revision."""
        return self._output / f"{revision.folder}.log"

    def stored(self, revision: Revision) -> StoredRun | None:
        """Return the run of a revision; None where there is none."""
        from pytest_libero_max.runs.store import read_pairs

        with suppress(ReportError):
            return read_pairs(self.folder(revision))
        return None

    def end(self, revision: Revision, given: Path | None, rule: str | None) -> StoredRun:
        """Return the run of the good or the bad end, which is played unless one is given.

        Raises:
            OptionError: It cannot be played.
            ReportError: The run that is given cannot be read.
        """
        from pytest_libero_max.runs.store import read_pairs

        if given is not None:
            return read_pairs(given)
        flags = [*self._cases, "--override-ini=libero_max_gate="]
        flags += [] if rule is None else [f"--libero-max-stop={rule}"]
        found = self.play(revision, flags, by_rule=rule is not None)
        if found is None:
            raise OptionError(self.trouble(revision))
        return found

    def trouble(self, revision: Revision) -> str:
        """Return an error about a revision that has to be played and cannot be."""
        lines = self.log(revision).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        said = f" It ends with: {lines[-1]}" if lines else ""
        return f"{revision.short} cannot be played; {self.log(revision)} has what pytest printed.{said}"

    def play(self, revision: Revision, flags: Sequence[str], *, by_rule: bool) -> StoredRun | None:
        """Play a revision unless its run has ended already.

        Args:
            revision: The revision.
            flags: Arguments of pytest: the cases, and what stops the run.
            by_rule: True if a run that its stopping rule has ended will do.

        Returns:
            None where it cannot be played.
        """
        from pytest_libero_max.lab.bisection import has_ended

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
        from pytest_libero_max.benchmark.manifests import Manifest
        from pytest_libero_max.runs.outside import cases_of_run

        asked = self._cases[0].partition("=")[2] if self._cases else None
        whole = cases_of_run(good.run.provenance, asked, "--libero-max-manifest")
        cases = tuple(case for case in whole if case.case_id in set(lost.case_ids))
        path = self._output / "lost.json"
        path.write_text(
            Manifest(f"lost-{whole.benchmark_id}", whole.version, whole.protocol, cases).to_json()
        )
        return [f"--libero-max-manifest={path}"]


def _split(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the arguments of pytest, and those of them that name the cases, with absolute paths.

    Raises:
        OptionError: One of them is given by this command, or the policy would be the same in each revision.
    """
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
