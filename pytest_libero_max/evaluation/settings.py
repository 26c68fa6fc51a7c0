"""Settings of a run: each is one field, which says how it is read and what it belongs to.

pytest's options, their ini twins and the arguments of :func:`pytest_libero_max.evaluate` are these fields.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.errors import LiberoMaxError, OptionError
from pytest_libero_max.evaluation import option_values as read
from pytest_libero_max.evaluation.processes.time_limits import Limits
from pytest_libero_max.pairing.probes.registry import PROBES
from pytest_libero_max.runs.media import MOST_FILMS, SELECTIONS
from pytest_libero_max.runs.protocol import played_settings, protocol_words
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.registry import INSTRUCTIONS, SEMANTICS, SOURCE_VARIATIONS, SUBSTRATES

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.programs import Program
    from pytest_libero_max.report.gates import Gate
    from pytest_libero_max.report.stopping_rule import NamedRule
    from pytest_libero_max.studies.study import Study

DEFAULT_OUTPUT = "libero-max-results"

Group = Literal["everyday", "protocol", "machines"]


ALWAYS: Any = object()
"""In the place of a setting's usual value: every value is recorded."""


@dataclass(frozen=True)
class Recorded:
    """What the records of a run say of a setting that may change a result.

    Agreement of records with their run, differences between runs, headers and replay commands follow from it.
    """

    part: Literal["protocol", "policy"]
    """Part of the provenance that holds it, under the name of the setting."""
    usual: Any = None
    """Value that is not recorded; :data:`ALWAYS` where every value is."""
    value: Callable[[Any], Any] = lambda value: value
    """Returns what the provenance holds."""


@dataclass(frozen=True)
class Option:
    """One setting: its flag is ``--libero-max-<name>``, its ini key ``libero_max_<name>``."""

    name: str
    metavar: str
    help: str
    parse: Callable[[str], Any]
    """Turns the text into a value; raises ``ValueError`` with the accepted form."""
    default: Any = None
    many: bool = False
    """True if it may be given several times (in the ini file: one a line)."""
    switch: bool = False
    """True for a flag without a value (in the ini file: true or false)."""
    recorded: Recorded | None = None
    """What records say of it; None for a setting that changes no result."""
    session: bool = False
    """True if it is about pytest's session, or about machines that only a session uses."""
    group: Group = "everyday"
    """Group of the help: what one needs every day, what may change a result, and the rest."""

    @property
    def flag(self) -> str:
        return f"--libero-max-{self.name}"

    @property
    def field(self) -> str:
        """Name of the field of :class:`Settings`."""
        return self.name.replace("-", "_")

    @property
    def key(self) -> str:
        return f"libero_max_{self.field}"

    def read(self, text: str, where: str) -> Any:
        """Return the value of a text.

        Raises:
            OptionError: It is not of the option's form.
        """
        try:
            return self.parse(text)
        except (ValueError, LiberoMaxError) as error:
            value = f"{self.name}={text!r}"  # errors about a gate begin with it, and it is said once
            message = str(error)
            rest = message.removeprefix(value) if message.startswith(value) else f": {message}"
            raise OptionError(f"{where}={text!r}{rest}") from None


def setting(
    metavar: str,
    help: str,
    parse: Callable[[str], Any],
    *,
    default: Any = None,
    many: bool = False,
    recorded: Recorded | None = None,
    session: bool = False,
    group: Group = "everyday",
) -> Any:
    """Declare a field of :class:`Settings`; arguments as of :class:`Option`. What is recorded is protocol."""
    default = () if many else default
    group = "protocol" if recorded is not None else group
    declared = {"metavar": metavar, "help": help, "parse": parse, "default": default, "many": many}
    return field(metadata={**declared, "recorded": recorded, "session": session, "group": group})


def switch(help: str, *, session: bool = False, group: Group = "everyday") -> Any:
    """Declare a setting that is on or off, likewise."""
    declared = {"metavar": "", "help": help, "parse": bool, "default": False}
    return field(metadata={**declared, "switch": True, "session": session, "group": group})


def _program_value(program: Program) -> Json:
    return {**program.to_dict(), "digest": program.digest}


@dataclass(frozen=True)
class Settings:
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
        read.text,
    )
    profile: str | None = setting(
        "NAME|PATH",
        "Profile of the policy behind a server's address: one of this package, or a TOML file",
        read.text,
        recorded=Recorded("policy"),
    )
    revision: str | None = setting(
        "TEXT",
        "Identity of the weights behind servers, for example a checkpoint's digest; runs over other "
        "addresses that declare the same are one measurement",
        read.text,
        recorded=Recorded("policy"),
    )
    track: str = setting(
        "NAME",
        "Frozen set of cases to play (default: smoke; on the libero substrate, original if what is installed "
        "does not play smoke)",
        read.text,
    )
    manifest: Path | None = setting("PATH", "Play the cases of this manifest instead of a track", read.text)
    program: Program | None = setting(
        "NAME|FILE",
        "Lay a program over the cases that it fits: which arms are played and what happens in them. One of "
        "`libero-max list programs`, or a JSON or TOML file",
        read.text,
        recorded=Recorded("protocol", value=_program_value),
    )
    only_installed: bool = switch(
        "Leave out the cases that need something which is not installed (libero-max doctor lists it), where "
        "otherwise nothing is played; before the limit",
        group="machines",
    )
    suites: tuple[str, ...] | None = setting(
        "SUITE,...",
        "Play only the cases of these suites, where a policy plays no others; before the limit",
        read.suites,
    )
    limit: int | None = setting(
        "N",
        "Play a stratified, deterministic subset of N cases, the same for every policy: it is chosen before "
        "the policy is loaded, from what --libero-max-suites and --libero-max-only-installed leave, and "
        "before -k and -m, which are pytest's own and choose among the N",
        read.positive,
    )
    shard: tuple[int, int] | None = setting(
        "I/N",
        "Play the I-th of N parts of the cases, or with env the part of this job of an array (Slurm, "
        "Kubernetes, AWS Batch, PBS, LSF, Grid Engine; LIBERO_MAX_SHARDS is N where the scheduler does not "
        "say it); join the runs with libero-max shards merge",
        read.shard,
        group="machines",
    )
    order: Order = setting(
        "ORDER",
        "Order of play: sorted, which keeps the cases of a scene together; blocks:SEED, a permutation in "
        "which every prefix has about the same share of each event and suite; or shuffled:SEED, one in which "
        "every prefix is a simple random sample, which the rule anytime needs; results do not depend on it "
        "(default: sorted)",
        read.order,
        group="machines",
    )
    stop: NamedRule | None = setting(
        "RULE",
        "Stop the run by a rule over the pairs measured so far, in the order of play: errors:N (N pairs could"
        " not be measured), first_regression, certain (no remaining outcome can change a gate), "
        "strata:LEVEL (a change in some event of some suite is shown at this level), "
        "anytime:LEVEL (at this level, a sequential test has decided the gates, or without gates has found a "
        "change), worse_than:RUN (Dynamic is shown to be worse than that of an earlier run), or a rule of "
        "another package, NAME or NAME:ARGUMENTS (default: none)",
        read.stopping_rule,
    )
    substrate: str = setting(
        "NAME",
        "Builder of the worlds: embedded, libero (an installed LIBERO, LIBERO-Plus or LIBERO-PRO), or tiny "
        "(a toy scene for manifests that name its entities)",
        read.known_in(SUBSTRATES),
        default="embedded",
    )
    libero: tuple[Path, ...] = setting(
        "FOLDER",
        "Checkout of LIBERO, LIBERO-Plus or LIBERO-PRO for the libero substrate; may be repeated, once a "
        "kind (default: what import libero finds)",
        read.text,
        many=True,
        group="machines",
    )
    libero_assets: Path | None = setting(
        "FOLDER",
        "Models and textures for an installation of the libero substrate that has none of its own",
        read.text,
        group="machines",
    )
    semantics: Literal["published", "corrected"] = setting(
        "WHICH",
        "Events of the libero substrate as published, defects included, or corrected",
        read.known_in(SEMANTICS),
        default="published",
        group="protocol",
    )
    instruction: Literal["published", "clean"] = setting(
        "WHICH",
        "Prompts of the libero substrate as published, where LIBERO-Plus's name the variation, or clean",
        read.known_in(INSTRUCTIONS),
        default="published",
        group="protocol",
    )
    source_variations: Literal["installed", "own"] = setting(
        "WHICH",
        "LIBERO-Plus's and LIBERO-PRO's variations on the libero substrate: the installed ones, or "
        "this package's own, made at reset on LIBERO's scenes",
        read.known_in(SOURCE_VARIATIONS),
        default="installed",
        group="protocol",
    )
    prefix: Literal["fork", "replay"] = setting(
        "MODE",
        "Way of Dynamic to the event: fork (from a snapshot taken in Base) or "
        "replay (the recorded actions, from reset)",
        read.known_in(("fork", "replay")),
        default="fork",
        recorded=Recorded("protocol"),
    )
    strength: float = setting(
        "FRACTION",
        "Let every event happen at this share of its change, 0 to 1; refused for events that happen whole or "
        "not at all",
        read.fraction,
        default=1.0,
        recorded=Recorded("protocol", usual=1.0),
    )
    study: Study | None = setting(
        "NAME[:SETTINGS]|FILE",
        "Play the arms of a study as well, and report them: camera-timing, camera-strength (both of the "
        "track camera unless another one is named), event-timing, audit, cadence:2,4,8 (values of Q) or "
        "cadence:2/2,4/4 (H/Q), latency:1,2,4,8 (steps that a query takes; 4sync for the runner that waits; "
        "both of the track lite, and always beside the policy's own), repeats or repeats:PLAYS (of the track "
        "smoke: each case 3 or so many times, with other seeds of the policy), one of another package, or a "
        "JSON or TOML file that spells one",
        read.study,
        recorded=Recorded("protocol", value=lambda study: study.to_dict()),
    )
    probe: tuple[str, ...] = setting(
        "NAME",
        "Read this in every arm as well, and keep its columns in the records; may be repeated "
        "(contact_timeline, or a probe of another package)",
        read.known_in(PROBES),
        many=True,
        group="protocol",
    )
    latency: Latency = setting(
        "TIME",
        "Let the world go on while the policy is asked: 200ms or 4steps (of 50 ms, rounded up). The robot "
        "goes on with the chunk before, and drops the actions of the new one that are late (asynchronous "
        "inference); with ,sync behind it, it waits for the answer. recorded:RUN draws the delay of each "
        "query from the query times of a run",
        read.latency,
        recorded=Recorded("protocol", usual=NO_LATENCY, value=str),
    )
    horizon: int | None = setting(
        "ACTIONS",
        "Override H (chunk size), the most actions a query returns",
        read.positive,
        recorded=Recorded("policy", usual=ALWAYS),
    )
    query_interval: int | None = setting(
        "ACTIONS",
        "Override Q (execution horizon, replan steps), the actions executed before the next query",
        read.positive,
        recorded=Recorded("policy", usual=ALWAYS),
    )
    restore: Literal["native", "always", "gated"] = setting(
        "MODE",
        "Restore the images before the policy sees them, by what they show alone: native (never), gated "
        "(those that look damaged) or always",
        read.known_in(("native", "gated", "always")),
        default="native",
        recorded=Recorded("policy", usual="native"),
    )
    adaptive: Literal["image", "privileged"] | None = setting(
        "WATCH",
        "Execute whole chunks, and ask the policy early where something changed, on average no oftener than "
        "every Q steps; watched are the fixed cameras (image) or the objects (privileged)",
        read.known_in(("image", "privileged")),
        recorded=Recorded("policy"),
    )
    strict: str | None = setting(
        "WHAT",
        "Also fail the pairs that are a regression (Base succeeds, Dynamic does not)",
        read.selection_in(("regressions",)),
        session=True,
    )
    traces: str = setting(
        "WHICH",
        "Keep step-by-step traces of these pairs in the output folder, from which libero-max film makes "
        "films: none, regressions, changed (Base and Dynamic end differently) or all",
        read.selection_in(SELECTIONS),
        default="none",
    )
    film: str = setting(
        "WHICH",
        "Film these pairs when all are measured, into films in the output folder: none, regressions, "
        "changed (Base and Dynamic end differently) or all",
        read.selection_in(SELECTIONS),
        default="none",
        session=True,
    )
    film_limit: int | None = setting(
        "PAIRS",
        "Film at most so many regressions and so many gains: at first one of each cause and event (default: "
        f"{MOST_FILMS}; with --libero-max-film=all, all pairs)",
        read.positive,
        session=True,
        group="machines",
    )
    progress: str = setting(
        "FORM",
        "Progress of the run: live (a line below pytest's output that is redrawn), lines (one a "
        "minute, later fewer), none, or auto (live in a terminal, otherwise lines, and with -q none)",
        read.known_in(("auto", "live", "lines", "none")),
        default="auto",
        session=True,
        group="machines",
    )
    noise_floor: int | None = setting(
        "PAIRS",
        "Play Base twice for a stratified subset of so many pairs and report how often it flips",
        read.positive,
        recorded=Recorded("protocol", usual=ALWAYS),
    )
    sham: float | None = setting(
        "SHARE",
        "Share of the pairs, 0 to 1, that also play a sham event: at the event's moment the policy is given "
        "other seeds, and nothing changes. What is lost then is lost by the policy's own chance. Dynamic is "
        "played with other seeds as well, so that flips beyond chance are known (default: 0.2 for a policy "
        "that is not repeatable, else 0)",
        read.fraction,
        recorded=Recorded("protocol"),
    )
    verify: int = setting(
        "PAIRS",
        "At the end play so many pairs again, by turns of each suite, each in a process of its own with a "
        "new home, cache and working folder, and compare outcome, steps and proofs: what a policy keeps from "
        "pair to pair shows there",
        read.count,
        default=0,
        session=True,
        group="machines",
    )
    gate: tuple[Gate, ...] = setting(
        "CONDITION",
        "Fail the run unless this holds of the report, for example 'dynamic_sr >= 0.6'; may be repeated. "
        "Then the pairs are played by a worker, also without -n; gates of a shard are decided by "
        "libero-max shards merge",
        read.gate,
        many=True,
    )
    timeout: Limits = setting(
        "query:S,step:S,pair:S",
        "Wall-clock limits, s, one or more of: query, one call of the policy; step, one step, reset or image "
        "of the simulator; pair, a pair with all its arms, without the loading of the policy. What takes "
        "longer makes its pair an error, never a failed episode (default: none)",
        read.limits,
        group="machines",
    )
    retries: int = setting(
        "N",
        "Play a pair again in a fresh process, so many times, after the process that played it has died",
        read.count,
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
        read.gibibytes,
        group="machines",
    )
    ray: read.Cluster | None = setting(
        "ADDRESS[,actors=N,cpus=N,gpus=N,ship]",
        "Play the pairs on a Ray cluster: HOST:PORT, ray://HOST:PORT, or auto for the cluster that this "
        "machine belongs to; needs the extra ray. Behind it: actors that play at once (default: as many as "
        "have room, also when nodes join or leave), CPUs and GPUs that each takes (default: 1 and 0; 0.25 "
        "where four policies share a GPU), and ship, which sends the folder in which pytest is called to "
        "nodes that do not share it",
        read.cluster,
        session=True,
        group="machines",
    )
    output: Path = setting(
        "FOLDER|auto",
        f"Folder for pairs.jsonl and report.json; auto: {DEFAULT_OUTPUT}-0001 and so on, with "
        "--libero-max-resume the last of them",
        read.text,
        default=DEFAULT_OUTPUT,
    )
    compare: str | None = setting(
        "RUN|last",
        "At the end, compare the run with this one; last: with the last complete run of the same cases "
        "beside the output folder",
        read.text,
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
        return SubstrateOptions(
            self.libero, self.libero_assets, self.semantics, self.instruction, self.source_variations
        )

    @property
    def in_order(self) -> bool:
        """True if pairs are to be handed out one by one: scenes are mixed, or a rule looks at the prefix."""
        return self.order.seed is not None or self.stop is not None

    def recorded(self, part: Literal["protocol", "policy"]) -> Json:
        """Return what the provenance of a run says in one of its parts, by setting."""
        values = {}
        for option in options_of(type(self)):
            declared, value = option.recorded, getattr(self, option.field)
            if declared is not None and declared.part == part and value != declared.usual:
                values[option.field] = declared.value(value)
        return values

    @property
    def played(self) -> dict[str, str]:
        """What each record says of the settings it was played with, among its fingerprints."""
        return played_settings(self.recorded("protocol"))

    @property
    def extras(self) -> str:
        """Words for pytest's header; empty for a plain run."""
        return "".join(f", {words}" for words in protocol_words(self.recorded("protocol")).values())

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
    "ray-actors": "ray=ADDRESS,actors=N",
    "ray-cpus": "ray=ADDRESS,cpus=N",
    "ray-gpus": "ray=ADDRESS,gpus=N",
    "ray-ship": "ray=ADDRESS,ship",
}
"""Options of before, with what says the same now."""


def options_of(kind: type[Settings]) -> tuple[Option, ...]:
    """Return the options that the fields of a class declare, in the order of the help."""
    return tuple(Option(item.name.replace("_", "-"), **item.metadata) for item in fields(kind))


OPTIONS = options_of(Settings)
"""Every option, in the order of the help."""
