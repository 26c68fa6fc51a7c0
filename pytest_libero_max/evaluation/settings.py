"""Settings of a run: each is one field, which says how it is read and what it belongs to.

pytest's options, their ini twins and the arguments of :func:`pytest_libero_max.evaluate` are these fields.
Those that may change a result are declared in :class:`~pytest_libero_max.runs.protocol.ProtocolSettings`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.benchmark.text_values import (
    amount,
    count,
    gibibytes,
    known_in,
    named_values,
    order,
    positive,
    seconds,
    suites,
    text,
)
from pytest_libero_max.conformance.subjects import Subject
from pytest_libero_max.evaluation.array_jobs import shard_of_job
from pytest_libero_max.evaluation.processes.time_limits import Limits
from pytest_libero_max.runs.media import MOST_FILMS, SELECTIONS, selection_named
from pytest_libero_max.runs.protocol import ProtocolSettings
from pytest_libero_max.runs.setting import options_of, setting, switch
from pytest_libero_max.substrates.contract import ChosenSubstrate, SubstrateOptions
from pytest_libero_max.substrates.registry import chosen_substrate

if TYPE_CHECKING:
    from pytest_libero_max.report.gates import Gate
    from pytest_libero_max.report.stopping_rule import NamedRule

DEFAULT_OUTPUT = "libero-max-results"


def limits(text: str) -> Limits:
    """Parse time limits by what they are of, with commas between."""
    return Limits(**named_values(text, ":", dict.fromkeys(("query", "step", "pair"), seconds)))


@dataclass(frozen=True)
class Cluster:
    """A Ray cluster that plays pairs."""

    address: str
    actors: int | None = None
    """Number of actors that play at once; None for as many as have room."""
    cpus: float = 1.0
    gpus: float = 0.0
    ship: bool = False
    """True if the working folder is sent to its nodes."""


def cluster(value: str) -> Cluster:
    """Parse the address of a Ray cluster with what its actors take."""
    address, *words = map(str.strip, value.split(","))
    ship = "ship" in words
    named = ",".join(word for word in words if word != "ship")
    rest = named_values(named, "=", {"actors": positive, "cpus": amount, "gpus": amount}) if named else {}
    parsed = Cluster(text(address), **rest, ship=ship)
    if parsed.actors is None and not parsed.cpus and not parsed.gpus:
        raise ValueError("with cpus=0 nothing says how many actors have room; add actors=N")
    return parsed


@dataclass(frozen=True)
class Films:
    """Pairs to film."""

    which: str
    most: int | None = None
    """Most regressions and most gains; None for the usual number."""

    def __str__(self) -> str:
        return self.which if self.most is None else f"{self.which}:{self.most}"


def films(text: str) -> Films:
    """Parse a selection of pairs to film, with the most of them behind a colon."""
    which, colon, most = text.partition(":")
    return Films(selection_in(SELECTIONS)(which), positive(most) if colon else None)


def shard(text: str) -> tuple[int, int]:
    """Parse the number and count of a part, both from 1."""
    if text == "env":
        return shard_of_job(os.environ)
    index, slash, count = text.partition("/")
    if not (slash and index.isascii() and index.isdigit() and count.isascii() and count.isdigit()):
        raise ValueError("expected I/N, for example 1/4, or env")
    if not 1 <= int(index) <= int(count):
        raise ValueError("expected I/N with 1 <= I <= N")
    return int(index), int(count)


def stopping_rule(text: str) -> NamedRule:
    """Parse a stopping rule with its arguments."""
    from pytest_libero_max.report.stopping_rule import parse_rule

    return parse_rule(text)


def gate(text: str) -> Gate:
    """Parse a condition on the report."""
    from pytest_libero_max.report.gates import parse_gate

    return parse_gate(text)


def selection_in(known: Collection[str]) -> Callable[[str], str]:
    """Return a parser of the name of a selection of pairs, in either number of *regression*."""
    parse = known_in(known)
    return lambda text: parse(selection_named(text))


@dataclass(frozen=True)
class Settings(ProtocolSettings):
    """Resolved settings. Without a policy the plugin only offers its fixtures.

    Each field declares an option: its name, its type once resolved, how it is read and what it belongs to.
    They are in the order of the help, whose texts have a capital letter, and no final period for one phrase.
    """

    policy: str | None = setting(
        "ADAPTER",
        "Policy to test: the name of a policy (expert, stale_expert, noop, random), FILE.py, "
        "FILE.py:NAME or PACKAGE.MODULE:NAME, or the address of a server (openpi://HOST:8000, with a "
        "profile), several equal ones with commas between, or a .toml file that lists them; given "
        "on the command line without test paths, every pair of the track is collected; given in the ini "
        "file, pytest libero-max plays them, and so does testpaths = libero-max",
        text,
    )
    conform: Subject | None = setting(
        "SUBJECT",
        "Examine a subject instead of playing pairs: one test for each rule that it must keep. SUBJECT is "
        "policy:ADAPTER, with ADAPTER as for --libero-max-policy, server:ADDRESS, substrate:NAME, "
        "loop:PACKAGE:FUNCTION, or env:PACKAGE:FACTORY",
        Subject.read,
        session=True,
    )
    xfails: Path | None = setting(
        "FILE",
        "Rules that the subject of --libero-max-conform is expected to break: a TOML file with a table for "
        "each id, which has a reason and may have a link",
        text,
        session=True,
        group="machines",
    )
    track: str = setting(
        "NAME",
        "Frozen set of cases to play (default: smoke; on the libero substrate, original if what is installed "
        "does not play smoke)",
        text,
    )
    manifest: Path | None = setting(
        "PATH", "Play the cases of this manifest instead of a track", text, group="protocol"
    )
    only_installed: bool = switch(
        "Leave out the cases that need something which is not installed (libero-max doctor lists it), where "
        "otherwise nothing is played; before the limit",
        group="machines",
    )
    suites: tuple[str, ...] | None = setting(
        "SUITE,...",
        "Play only the cases of these suites, where a policy plays no others; before the limit",
        suites,
    )
    limit: int | None = setting(
        "N",
        "Play a stratified, deterministic subset of N cases, the same for every policy: it is chosen before "
        "the policy is loaded, from what --libero-max-suites and --libero-max-only-installed leave, and "
        "before -k and -m, which are pytest's own and choose among the N",
        positive,
    )
    shard: tuple[int, int] | None = setting(
        "I/N",
        "Play the I-th of N parts of the cases, or with env the part of this job of an array (Slurm, "
        "Kubernetes, AWS Batch, PBS, LSF, Grid Engine; LIBERO_MAX_SHARDS is N where the scheduler does not "
        "say it); join the runs with libero-max shards merge",
        shard,
        group="machines",
    )
    order: Order = setting(
        "ORDER",
        "Order of play: sorted, which keeps the cases of a scene together; blocks:SEED, a permutation in "
        "which every prefix has about the same share of each event and suite; or shuffled:SEED, one in which "
        "every prefix is a simple random sample, which the rule anytime needs; results do not depend on it "
        "(default: sorted)",
        order,
        group="machines",
    )
    stop: NamedRule | None = setting(
        "RULE",
        "Stop the run by a rule over the pairs measured so far, in the order of play: errors:N (N pairs could"
        " not be measured), first_regression, certain (no remaining outcome can change a gate), "
        "anytime:LEVEL (at this level, a sequential test has decided the gates, or without gates has found a "
        "change), strata:LEVEL (a change in some event of some suite is shown at this level), worse_than:RUN "
        "(Dynamic is shown to be worse than that of an earlier run), or a rule of "
        "another package, NAME or NAME:ARGUMENTS (default: none)",
        stopping_rule,
    )
    substrate: ChosenSubstrate = setting(
        "NAME[:semantics=...,instruction=...,variations=...,images=...]",
        "Builder of the worlds: embedded, libero (an installed LIBERO, LIBERO-Plus or LIBERO-PRO), or tiny "
        "(a toy scene for manifests that name its entities). embedded takes images=2, or images=1 to play "
        "runs from before 2026-11-26 again; libero takes semantics=published (events with "
        "the defects of the authors' code) or corrected; instruction=published (LIBERO-Plus's prompts name "
        "the variation) or clean; variations=installed (LIBERO-Plus's and LIBERO-PRO's) or own (this "
        "package's, made at reset on LIBERO's scenes)",
        chosen_substrate,
        default=ChosenSubstrate("embedded"),
    )
    libero: tuple[Path, ...] = setting(
        "FOLDER",
        "Checkout of LIBERO, LIBERO-Plus or LIBERO-PRO for the libero substrate; may be repeated, once a "
        "kind (default: what import libero finds)",
        text,
        many=True,
        group="machines",
    )
    libero_assets: Path | None = setting(
        "FOLDER",
        "Models and textures for an installation of the libero substrate that has none of its own",
        text,
        group="machines",
    )
    strict: str | None = setting(
        "WHAT",
        "Also fail the pairs that are a regression (Base succeeds, Dynamic does not)",
        selection_in(("regressions",)),
        session=True,
    )
    traces: str = setting(
        "WHICH",
        "Keep step-by-step traces of these pairs in the output folder, from which libero-max film makes "
        "films: none, regressions, changed (Base and Dynamic end differently) or all",
        selection_in(SELECTIONS),
        default="none",
    )
    film: Films = setting(
        "WHICH[:PAIRS]",
        "Film these pairs when all are measured, into films in the output folder: none, regressions, "
        "changed (Base and Dynamic end differently) or all; at most PAIRS regressions and so many gains, at "
        f"first one of each cause and event. PAIRS is {MOST_FILMS} unless given, and with all no limit",
        films,
        default=Films("none"),
        session=True,
    )
    progress: str = setting(
        "FORM",
        "Progress of the run: live (a line below pytest's output that is redrawn), lines (one a "
        "minute, later fewer), none, or auto (live in a terminal, otherwise lines, and with -q none)",
        known_in(("auto", "live", "lines", "none")),
        default="auto",
        session=True,
        group="machines",
    )
    verify: int = setting(
        "PAIRS",
        "At the end play so many pairs again, by turns of each suite, each in a process of its own with a "
        "new home, cache and working folder, and compare outcome, steps and proofs: what a policy keeps from "
        "pair to pair shows there",
        count,
        default=0,
        session=True,
        group="machines",
    )
    gate: tuple[Gate, ...] = setting(
        "CONDITION",
        "Fail the run unless this holds of the report, for example 'dynamic_sr >= 0.6'; may be repeated. "
        "Then the pairs are played by a worker, also without -n; gates of a shard are decided by "
        "libero-max shards merge",
        gate,
        many=True,
    )
    timeout: Limits = setting(
        "query:S,step:S,pair:S",
        "Wall-clock limits, s, one or more of: query, one call of the policy; step, one step, reset or image "
        "of the simulator; pair, a pair with all its arms, without the loading of the policy. What takes "
        "longer makes its pair an error, never a failed episode (default: none)",
        limits,
        group="machines",
    )
    retries: int = setting(
        "N",
        "Play a pair again in a fresh process, so many times, after the process that played it has died",
        count,
        default=2,
        group="machines",
    )
    isolate: bool = switch(
        "Play each pair in a process of its own, with the policy loaded in it",
        session=True,
        group="machines",
    )
    memory: float | None = setting(
        "GIB",
        "Memory limit of a process that plays pairs: GiB, none, or auto, which is its share of 0.9 of this "
        "machine's memory and at least 4 (default: auto)",
        gibibytes,
        group="machines",
    )
    ray: Cluster | None = setting(
        "ADDRESS[,actors=N,cpus=N,gpus=N,ship]",
        "Play the pairs on a Ray cluster: HOST:PORT, ray://HOST:PORT, or auto for the cluster that this "
        "machine belongs to; needs the extra ray. Behind it: actors that play at once (default: as many as "
        "have room, also when nodes join or leave), CPUs and GPUs that each takes (default: 1 and 0; 0.25 "
        "where four policies share a GPU), and ship, which sends the folder in which pytest is called to "
        "nodes that do not share it",
        cluster,
        session=True,
        group="machines",
    )
    output: Path = setting(
        "FOLDER|auto",
        f"Folder for pairs.jsonl and report.json; auto: {DEFAULT_OUTPUT}-0001 and so on, with "
        "--libero-max-resume the last of them",
        text,
        default=DEFAULT_OUTPUT,
    )
    compare: str | None = setting(
        "RUN|last",
        "At the end, compare the run with this one; last: with the last complete run of the same cases "
        "beside the output folder",
        text,
        session=True,
    )
    resume: bool = switch("Continue the run in the output folder, skipping the pairs it has measured")

    @property
    def reference(self) -> str:
        """Name, path or address that the policy is loaded from."""
        assert self.policy is not None
        return self.policy

    @property
    def substrate_options(self) -> SubstrateOptions:
        """Options of the substrate."""
        return replace(self.substrate.options, installations=self.libero, assets=self.libero_assets)

    @property
    def in_order(self) -> bool:
        """True if pairs are to be handed out one by one: scenes are mixed, or a rule looks at the prefix."""
        return self.order.seed is not None or self.stop is not None

    @property
    def case_set(self) -> str:
        """Name of the track or manifest for people."""
        return f"manifest {self.manifest.name}" if self.manifest else f"track {self.track}"


GONE = {
    "cadence": "study=cadence:SETTINGS",
    "delays": "study=latency:SETTINGS",
    "repeats": "study=repeats:PLAYS",
    "query-timeout": "timeout=query:S",
    "step-timeout": "timeout=step:S",
    "pair-timeout": "timeout=pair:S",
    "semantics": "substrate=libero:semantics=WHICH",
    "instruction": "substrate=libero:instruction=WHICH",
    "source-variations": "substrate=libero:variations=WHICH",
    "restore": "wrap=restore:MODE",
    "adaptive": "wrap=adaptive:WATCH",
    "noise-floor": "noise=floor:PAIRS",
    "sham": "noise=sham:SHARE",
    "film-limit": "film=WHICH:PAIRS",
    "ray-actors": "ray=ADDRESS,actors=N",
    "ray-cpus": "ray=ADDRESS,cpus=N",
    "ray-gpus": "ray=ADDRESS,gpus=N",
    "ray-ship": "ray=ADDRESS,ship",
}
"""Options of before, with what says the same now."""


OPTIONS = options_of(Settings)
"""Every option, in the order of the help."""
