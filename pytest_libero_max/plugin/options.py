"""Command-line options, their ini twins, and the settings they resolve to.

Precedence, for every option: command line, then ini file, then default.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import pytest

from pytest_libero_max.benchmark.documents import Json, known
from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.errors import LiberoMaxError, did_you_mean
from pytest_libero_max.pairing.probes.registry import PROBES
from pytest_libero_max.plugin import option_values as read
from pytest_libero_max.plugin.ini_values import in_file, native_value
from pytest_libero_max.plugin.processes.time_limits import Limits
from pytest_libero_max.runs.media import MOST_FILMS, SELECTIONS
from pytest_libero_max.runs.replay_command import Places
from pytest_libero_max.studies.registry import SETTINGS_OPTIONS, STUDIES
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.registry import INSTRUCTIONS, SEMANTICS, SOURCE_VARIATIONS, SUBSTRATES

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.order import Order
    from pytest_libero_max.benchmark.programs import Program
    from pytest_libero_max.report.gates import Gate
    from pytest_libero_max.report.stopping_rule import NamedRule
    from pytest_libero_max.studies.study import Study

DEFAULT_OUTPUT = "libero-max-results"

POLICY_FLAG = "--libero-max-policy"


@dataclass(frozen=True)
class Option:
    """One setting: its flag is ``--libero-max-<name>``, its ini key ``libero_max_<name>``.

    Attributes:
        parse: Turns the text into a value; raises ``ValueError`` with the accepted form.
        many: True if it may be given several times (in the ini file: one a line).
        switch: True for a flag without a value (in the ini file: true or false).
    """

    name: str
    metavar: str
    help: str
    parse: Callable[[str], Any]
    default: Any = None
    many: bool = False
    switch: bool = False

    @property
    def flag(self) -> str:
        return f"--libero-max-{self.name}"

    @property
    def key(self) -> str:
        return f"libero_max_{self.name.replace('-', '_')}"


def _option(
    metavar: str, help: str, parse: Callable[[str], Any], *, default: Any = None, many: bool = False
) -> Any:
    """Declare the option of a field of :class:`Settings`; arguments as there."""
    told = {"metavar": metavar, "help": help, "parse": parse, "default": () if many else default}
    return field(metadata={**told, "many": many})


def _switch(help: str) -> Any:
    """Declare an option without a value, likewise."""
    return field(metadata={"metavar": "", "help": help, "parse": bool, "default": False, "switch": True})


@dataclass(frozen=True)
class Settings:
    """Resolved options. Without a policy the plugin only offers its fixtures.

    Each field declares an option: its name, its type once resolved, and how it is read. They are in the order
    of the help, whose texts have a capital letter, and no final period for one phrase.
    """

    policy: str | None = _option(
        "ADAPTER",
        "Policy to test: the name of a policy (expert, stale_expert, noop, random), FILE.py, "
        "FILE.py:NAME or PACKAGE.MODULE:NAME, or the address of a server (openpi://HOST:8000, with a "
        "profile), several equal ones with commas between, or a .toml file that lists them; given "
        "on the command line without test paths, every pair of the track is collected; given in the ini "
        "file, pytest libero-max plays them, and so does testpaths = libero-max",
        read.text,
    )
    profile: str | None = _option(
        "NAME|PATH",
        "Profile of the policy behind a server's address: one of this package, or a TOML file",
        read.text,
    )
    revision: str | None = _option(
        "TEXT",
        "Identity of the weights behind servers, for example a checkpoint's digest; runs over other "
        "addresses that declare the same are one measurement",
        read.text,
    )
    track: str = _option(
        "NAME",
        "Frozen set of cases to play (default: smoke; on the libero substrate, original if what is installed "
        "does not play smoke)",
        read.text,
    )
    manifest: Path | None = _option("PATH", "Play the cases of this manifest instead of a track", read.text)
    program: Program | None = _option(
        "NAME|FILE",
        "Lay a program over the cases that it fits: which arms are played and what happens in them. One of "
        "`libero-max list programs`, or a JSON file",
        read.text,
    )
    only_installed: bool = _switch(
        "Leave out the cases that need something which is not installed (libero-max doctor lists it), where "
        "otherwise nothing is played; before the limit"
    )
    suites: tuple[str, ...] | None = _option(
        "SUITE,...",
        "Play only the cases of these suites, where a policy plays no others; before the limit",
        read.suites,
    )
    limit: int | None = _option(
        "N",
        "Play a stratified, deterministic subset of N cases, the same for every policy: it is chosen before "
        "the policy is loaded, from what --libero-max-suites and --libero-max-only-installed leave, and "
        "before -k and -m, which are pytest's own and choose among the N",
        read.positive,
    )
    shard: tuple[int, int] | None = _option(
        "I/N",
        "Play the I-th of N parts of the cases, or with env the part of this job of an array (Slurm, "
        "Kubernetes, AWS Batch, PBS, LSF, Grid Engine; LIBERO_MAX_SHARDS is N where the scheduler does not "
        "say it); join the runs with libero-max shards merge",
        read.shard,
    )
    order: Order = _option(
        "ORDER",
        "Order of play: sorted, which keeps the cases of a scene together; blocks:SEED, a permutation in "
        "which every prefix has about the same share of each event and suite; or shuffled:SEED, one in which "
        "every prefix is a simple random sample, which the rule anytime needs; results do not depend on it "
        "(default: sorted)",
        read.order,
    )
    stop: NamedRule | None = _option(
        "RULE",
        "Stop the run by a rule over the pairs measured so far, in the order of play: errors:N (N pairs could"
        " not be measured), first_regression, certain (no remaining outcome can change a gate), "
        "strata:LEVEL (a change in some event of some suite is shown at this level), "
        "anytime:LEVEL (at this level, a sequential test has decided the gates, or without gates has found a "
        "change), worse_than:RUN (Dynamic is shown to be worse than that of an earlier run), or a rule of "
        "another package, NAME or NAME:ARGUMENTS (default: none)",
        read.stopping_rule,
    )
    substrate: str = _option(
        "NAME",
        "Builder of the worlds: embedded, libero (an installed LIBERO, LIBERO-Plus or LIBERO-PRO), or tiny "
        "(a toy scene for manifests that name its entities)",
        read.known_in(SUBSTRATES),
        default="embedded",
    )
    libero: tuple[Path, ...] = _option(
        "FOLDER",
        "Checkout of LIBERO, LIBERO-Plus or LIBERO-PRO for the libero substrate; may be repeated, once a "
        "kind (default: what import libero finds)",
        read.text,
        many=True,
    )
    libero_assets: Path | None = _option(
        "FOLDER",
        "Models and textures for an installation of the libero substrate that has none of its own",
        read.text,
    )
    semantics: Literal["published", "corrected"] = _option(
        "WHICH",
        "Events of the libero substrate as published, defects included, or corrected",
        read.known_in(SEMANTICS),
        default="published",
    )
    instruction: Literal["published", "clean"] = _option(
        "WHICH",
        "Prompts of the libero substrate as published, where LIBERO-Plus's name the variation, or clean",
        read.known_in(INSTRUCTIONS),
        default="published",
    )
    source_variations: Literal["installed", "own"] = _option(
        "WHICH",
        "LIBERO-Plus's and LIBERO-PRO's variations on the libero substrate: the installed ones, or "
        "this package's own, made at reset on LIBERO's scenes",
        read.known_in(SOURCE_VARIATIONS),
        default="installed",
    )
    prefix: Literal["fork", "replay"] = _option(
        "MODE",
        "Way of Dynamic to the event: fork (from a snapshot taken in Base) or "
        "replay (the recorded actions, from reset)",
        read.known_in(("fork", "replay")),
        default="fork",
    )
    strength: float = _option(
        "FRACTION",
        "Let every event happen at this share of its change, 0 to 1; refused for events that happen whole or "
        "not at all",
        read.fraction,
        default=1.0,
    )
    study: Study | None = _option(
        "NAME",
        "Play the arms of a study as well, and report them: camera-timing, camera-strength (both of the "
        "track camera unless another one is named), event-timing, cadence and latency (of the track lite), "
        "audit and repeats, or one of another package",
        read.known_in(STUDIES),
    )
    cadence: str | None = _option(
        "SETTINGS",
        "Play the study cadence with these settings: values of Q, for example 2,4,8, or of H/Q, for example "
        "2/2,4/4,8/8; the policy's own cadence is always played",
        read.text,
    )
    delays: str | None = _option(
        "SETTINGS",
        "Play the study latency with these settings: steps that a query takes, for example 1,2,4,8, or 4sync "
        "for the runner that waits; no delay is always played",
        read.text,
    )
    repeats: str | None = _option(
        "PLAYS",
        "Play each case so often, with other seeds of the policy, and report the variance between seeds, "
        "cases and tasks: the study repeats, which plays 3 (of the track smoke unless another one is named)",
        read.text,
    )
    probe: tuple[str, ...] = _option(
        "NAME",
        "Read this in every arm as well, and keep its columns in the records; may be repeated "
        "(contact_timeline, or a probe of another package)",
        read.known_in(PROBES),
        many=True,
    )
    latency: Latency = _option(
        "TIME",
        "Let the world go on while the policy is asked: 200ms or 4steps (of 50 ms, rounded up). The robot "
        "goes on with the chunk before, and drops the actions of the new one that are late (asynchronous "
        "inference); with ,sync behind it, it waits for the answer. recorded:RUN draws the delay of each "
        "query from the query times of a run",
        read.latency,
    )
    horizon: int | None = _option(
        "ACTIONS", "Override H (chunk size), the most actions a query returns", read.positive
    )
    query_interval: int | None = _option(
        "ACTIONS",
        "Override Q (execution horizon, replan steps), the actions executed before the next query",
        read.positive,
    )
    restore: Literal["native", "always", "gated"] = _option(
        "MODE",
        "Restore the images before the policy sees them, by what they show alone: native (never), gated "
        "(those that look damaged) or always",
        read.known_in(("native", "gated", "always")),
        default="native",
    )
    adaptive: Literal["image", "privileged"] | None = _option(
        "WATCH",
        "Execute whole chunks, and ask the policy early where something changed, on average no oftener than "
        "every Q steps; watched are the fixed cameras (image) or the objects (privileged)",
        read.known_in(("image", "privileged")),
    )
    strict: str | None = _option(
        "WHAT",
        "Also fail the pairs that are a regression (Base succeeds, Dynamic does not)",
        read.selection_in(("regressions",)),
    )
    traces: str = _option(
        "WHICH",
        "Keep step-by-step traces of these pairs in the output folder, from which libero-max film makes "
        "films: none, regressions, changed (Base and Dynamic end differently) or all",
        read.selection_in(SELECTIONS),
        default="none",
    )
    film: str = _option(
        "WHICH",
        "Film these pairs when all are measured, into films in the output folder: none, regressions, "
        "changed (Base and Dynamic end differently) or all",
        read.selection_in(SELECTIONS),
        default="none",
    )
    film_limit: int | None = _option(
        "PAIRS",
        "Film at most so many regressions and so many gains: at first one of each cause and event (default: "
        f"{MOST_FILMS}; with --libero-max-film=all, all pairs)",
        read.positive,
    )
    progress: str = _option(
        "FORM",
        "Progress of the run: live (a line below pytest's output that is redrawn), lines (one a "
        "minute, later fewer), none, or auto (live in a terminal, otherwise lines, and with -q none)",
        read.known_in(("auto", "live", "lines", "none")),
        default="auto",
    )
    noise_floor: int | None = _option(
        "PAIRS",
        "Play Base twice for a stratified subset of so many pairs and report how often it flips",
        read.positive,
    )
    sham: float | None = _option(
        "SHARE",
        "Share of the pairs, 0 to 1, that also play a sham event: at the event's moment the policy is given "
        "other seeds, and nothing changes. What is lost then is lost by the policy's own chance. Dynamic is "
        "played with other seeds as well, so that flips beyond chance are known (default: 0.2 for a policy "
        "that is not repeatable, else 0)",
        read.fraction,
    )
    verify: int = _option(
        "PAIRS",
        "At the end play so many pairs again, by turns of each suite, each in a process of its own with a "
        "new home, cache and working folder, and compare outcome, steps and proofs: what a policy keeps from "
        "pair to pair shows there",
        read.count,
        default=0,
    )
    gate: tuple[Gate, ...] = _option(
        "CONDITION",
        "Fail the run unless this holds of the report, for example 'dynamic_sr >= 0.6'; may be repeated. "
        "Then the pairs are played by a worker, also without -n; gates of a shard are decided by "
        "libero-max shards merge",
        read.gate,
        many=True,
    )
    query_timeout: float | None = _option(
        "SECONDS",
        "Wall-clock limit of one call of the policy; what takes longer makes its pair an error, never a "
        "failed episode (default: none)",
        read.seconds,
    )
    step_timeout: float | None = _option(
        "SECONDS",
        "Wall-clock limit of one step, reset or image of the simulator (default: none)",
        read.seconds,
    )
    pair_timeout: float | None = _option(
        "SECONDS",
        "Wall-clock limit of a pair with all its arms, without the loading of the policy (default: none)",
        read.seconds,
    )
    retries: int = _option(
        "N",
        "Play a pair again in a fresh process, so many times, after the process that played it has died",
        read.count,
        default=2,
    )
    isolate: bool = _switch("Play each pair in a process of its own, with the policy loaded in it")
    memory: float | None = _option(
        "GIB",
        "Memory limit of a process that plays pairs: GiB, none, or auto, which is its share of 0.9 of this "
        "machine's memory and at least 4 (default: auto)",
        read.gibibytes,
    )
    ray: str | None = _option(
        "ADDRESS",
        "Play the pairs on a Ray cluster: HOST:PORT, ray://HOST:PORT, or auto for the cluster that this "
        "machine belongs to; needs the extra ray",
        read.text,
    )
    ray_actors: int | None = _option(
        "N",
        "Actors that play at once on the Ray cluster, or auto: as many as have room, also when nodes join or "
        "leave (default: auto)",
        read.positive_or_auto,
    )
    ray_cpus: float = _option("CPUS", "CPUs of the Ray cluster that an actor takes", read.amount, default=1.0)
    ray_gpus: float = _option(
        "GPUS",
        "GPUs of the Ray cluster that an actor takes, for example 0.25 where four policies share one "
        "(default: none)",
        read.amount,
        default=0.0,
    )
    ray_ship: bool = _switch(
        "Send the folder in which pytest is called to the nodes of the Ray cluster, which do not share it"
    )
    output: Path = _option(
        "FOLDER|auto",
        f"Folder for pairs.jsonl and report.json; auto: {DEFAULT_OUTPUT}-0001 and so on, with "
        "--libero-max-resume the last of them",
        read.text,
        default=DEFAULT_OUTPUT,
    )
    compare: str | None = _option(
        "RUN|last",
        "At the end, compare the run with this one; last: with the last complete run of the same cases "
        "beside the output folder",
        read.text,
    )
    resume: bool = _switch("Continue the run in the output folder, skipping the pairs it has measured")

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
    def timeouts(self) -> Limits:
        """Wall-clock limits, s."""
        return Limits(self.query_timeout, self.step_timeout, self.pair_timeout)

    @property
    def in_order(self) -> bool:
        """True if pairs are to be handed out one by one: scenes are mixed, or a rule looks at the prefix."""
        return self.order.seed is not None or self.stop is not None

    @property
    def protocol(self) -> Json:
        """Choices for the run that could change a result, for its header."""
        program = self.program
        return {
            "prefix": self.prefix,
            "noise_floor": self.noise_floor,
            **known(
                sham=self.sham,
                strength=None if self.strength == 1.0 else self.strength,
                study=None if self.study is None else self.study.to_dict(),
                latency=None if self.latency == NO_LATENCY else str(self.latency),
                program=None if program is None else {**program.to_dict(), "digest": program.digest},
            ),
        }

    @property
    def extras(self) -> str:
        """Strength, latency, study and program for pytest's header; empty for a plain run."""
        strength = "" if self.strength == 1.0 else f", events at strength {self.strength:g}"
        latency = "" if self.latency == NO_LATENCY else f", latency {self.latency}"
        study = "" if self.study is None else f", study {self.study.name}"
        program = (
            "" if self.program is None else f", program {self.program.name} ({self.program.digest[:12]})"
        )
        return strength + latency + study + program

    @property
    def case_set(self) -> str:
        """Name of the track or manifest for people."""
        return f"manifest {self.manifest.name}" if self.manifest else f"track {self.track}"


OPTIONS = tuple(Option(item.name.replace("_", "-"), **item.metadata) for item in fields(Settings))
"""Every option, in the order of the help."""

_OPTION_OF = {option.key: option for option in OPTIONS}


@contextmanager
def usage_errors(begin: str = "") -> Iterator[None]:
    """Turn an error of this package in the block into a usage error, whose message begins with ``begin``."""
    try:
        yield
    except LiberoMaxError as error:
        raise pytest.UsageError(f"{begin}{error}") from None


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare every option and its ini twin."""
    group = parser.getgroup(
        "libero-max", "LIBERO-MAX: paired evaluation of robot policies under mid-execution events"
    )
    for option in OPTIONS:
        default = f" (default: {option.default})" if option.default else ""
        how: dict[str, Any] = {"metavar": option.metavar, "action": "append" if option.many else "store"}
        if option.switch:
            how = {"action": "store_true"}
        group.addoption(option.flag, dest=option.key, default=None, help=option.help + default, **how)
        words = f"{option.help}{default}; overridden by {option.flag}"
        kind: Literal["linelist", "string", "bool"] = "linelist" if option.many else "string"
        if option.switch:
            kind = "bool"
        parser.addini(option.key, words, kind, default=None)


def resolve(config: pytest.Config) -> Settings:
    """Return settings from the command line and the ini file.

    Raises:
        pytest.UsageError: A value is not of its option's form, or two options contradict each other.
    """
    values = {option.key.removeprefix("libero_max_"): _value(config, option) for option in OPTIONS}
    if values["manifest"] is not None:
        if config.getoption("libero_max_track") is not None:
            raise pytest.UsageError(
                "--libero-max-track and --libero-max-manifest both name the cases; give one of them."
            )
        values["manifest"] = _path(config, values["manifest"])
    values["output"] = _output(config, values["output"], values["resume"])
    values["program"] = _program(config, values)
    values["libero"] = tuple(_path(config, folder) for folder in values["libero"])
    if values["libero_assets"] is not None:
        values["libero_assets"] = _path(config, values["libero_assets"])
    _check_substrate_options(config, values["substrate"])
    from pytest_libero_max.benchmark.order import Order

    values["order"] = values["order"] or Order()
    _check_ray(config, values)
    values["study"] = _study(config, values)
    values["latency"] = values["latency"] or NO_LATENCY
    if values["latency"].drawn:  # the folder of a recorded run may be missing where a worker is
        config.option.libero_max_latency = str(values["latency"])
    if values["latency"] != NO_LATENCY and values["adaptive"] is not None:
        raise pytest.UsageError(
            f"--libero-max-latency={values['latency']} is of a policy that is asked every Q steps, but "
            f"--libero-max-adaptive={values['adaptive']} chooses when to ask. Leave one of them out."
        )
    horizon, interval = values["horizon"], values["query_interval"]
    if horizon is not None and interval is not None and interval > horizon:
        raise pytest.UsageError(
            f"--libero-max-query-interval={interval} > --libero-max-horizon={horizon}: a query returns "
            "at most H actions, so no more than H can be executed before the next (Q <= H). "
            "Lower Q or raise H."
        )
    if values["shard"] is not None:  # a worker on another machine has another environment
        config.option.libero_max_shard = "{}/{}".format(*values["shard"])
    settings = Settings(**values)
    return replace(settings, track=_track(settings, values["track"]))


_SUBSTRATE_OPTIONS = {
    "libero": "installations",
    "libero-assets": "assets",
    "semantics": "semantics",
    "instruction": "instruction",
    "source-variations": "variations",
}
"""The field of :class:`.SubstrateOptions` that an option fills, by the option's name."""


def _check_substrate_options(config: pytest.Config, substrate: str) -> None:
    """Check that the substrate reads the options that are given for it.

    Raises:
        pytest.UsageError: It does not.
    """
    for name, filled in _SUBSTRATE_OPTIONS.items():
        given = config.getoption(f"libero_max_{name.replace('-', '_')}") is not None
        if given and filled not in SUBSTRATES[substrate].reads:
            readers = [kind.name for kind in SUBSTRATES.values() if filled in kind.reads]
            raise pytest.UsageError(
                f"--libero-max-{name} is for the {' or '.join(readers)} substrate, but the substrate is "
                f"{substrate}. Add --libero-max-substrate={readers[0]}."
            )


def _check_ray(config: pytest.Config, values: dict[str, Any]) -> None:
    """Check the options about actors.

    Raises:
        pytest.UsageError: There is no cluster for them, or nothing says how many have room.
    """
    given = [
        option.flag
        for option in OPTIONS
        if option.name.startswith("ray-") and config.getoption(option.key) is not None
    ]
    if given and values["ray"] is None:
        raise pytest.UsageError(f"{given[0]} is for a Ray cluster. Add --libero-max-ray=ADDRESS.")
    if values["ray_actors"] is None and not values["ray_cpus"] and not values["ray_gpus"]:
        raise pytest.UsageError(
            "--libero-max-ray-cpus=0: nothing says how many actors have room. Give --libero-max-ray-actors=N."
        )


def _track(settings: Settings, name: str | None) -> str:
    from pytest_libero_max.plugin.case_support import supported_track

    if settings.manifest is not None:
        return name or ""
    return supported_track(name, settings.substrate, settings.substrate_options)


def _study(config: pytest.Config, values: dict[str, Any]) -> Study | None:
    """Return the study that is asked for; the track becomes that of the study where none is named.

    Raises:
        pytest.UsageError: Its settings are missing, of another form or those of another study, or it sets
            strengths itself.
    """
    options = SETTINGS_OPTIONS.items()
    given = {swept: text for swept, option in options if (text := values[option]) is not None}
    name = values["study"] = values["study"] or next(iter(given), None)
    for swept in given:
        if swept != name:
            raise pytest.UsageError(
                f"--libero-max-{SETTINGS_OPTIONS[swept]} is for the study {swept}, but the study is {name}. "
                "Take one of the two away."
            )
    if name is None:
        return None
    with usage_errors():
        study = STUDIES[name].of(given.get(name))
    if name in ("cadence", "latency") and values["adaptive"] is not None:
        raise pytest.UsageError(
            f"--libero-max-study={name} plays fixed query intervals, but "
            f"--libero-max-adaptive={values['adaptive']} chooses when to ask. Leave one of them out."
        )
    if name == "latency" and values["latency"] not in (None, NO_LATENCY):
        raise pytest.UsageError(
            "--libero-max-study=latency plays delays of its own, but "
            f"--libero-max-latency={values['latency']} is given. Leave one of the two out."
        )
    if study.scales and values["strength"] != 1.0:
        raise pytest.UsageError(
            f"--libero-max-study={name} plays the event at strengths of its own, but "
            f"--libero-max-strength={values['strength']:g} is given. Leave one of the two out."
        )
    if values["track"] is None:
        values["track"] = study.track
    return study


def _program(config: pytest.Config, values: dict[str, Any]) -> Program | None:
    """Return the program that is named.

    Raises:
        pytest.UsageError: It cannot be read, or a study is asked for as well.
    """
    if values["program"] is None:
        return None
    from pytest_libero_max.benchmark.programs import find_program

    if values["study"] is not None:
        raise pytest.UsageError(
            f"--libero-max-study={values['study']} plays its arms beside Base and Dynamic of the event, but "
            "--libero-max-program chooses the arms. Leave one of the two out."
        )
    with usage_errors("--libero-max-program: "):
        return find_program(values["program"], config.invocation_params.dir)


def places_of(config: pytest.Config, settings: Settings) -> Places:
    """Return what a session needs of this machine to play pairs of this one again, in another folder."""
    from pytest_libero_max.policies.references import absolute_reference

    folder, option = config.invocation_params.dir, config.option
    profile = settings.profile
    arguments = [f"--rootdir={config.rootpath}", "-p", "pytest_libero_max.plugin.fresh_folder"]
    arguments += [] if config.inipath is None else ["-c", str(config.inipath)]
    arguments += [word for text in option.override_ini or () for word in ("-o", text)]
    arguments += [word for name in option.plugins or () for word in ("-p", name)]
    return Places(
        absolute_reference(settings.reference, folder),
        str(_path(config, profile)) if profile is not None and profile.endswith(".toml") else profile,
        None if settings.manifest is None else str(settings.manifest.absolute()),
        None,
        tuple(map(str, settings.libero)),
        None if settings.libero_assets is None else str(settings.libero_assets),
        tuple(arguments),
    )


def given(config: pytest.Config, name: str) -> bool:
    """Return True if an option is given on the command line or in the ini file."""
    key = f"libero_max_{name}"
    return bool(config.getoption(key, None) or ini_value(config, key))


def require_known_keys(config: pytest.Config) -> None:
    """Check the keys of the ini file, and of ``-o``, that look like ours: pytest itself only warns.

    Raises:
        pytest.UsageError: One is unknown; suggests the closest.
    """
    known = {option.key for option in OPTIONS}
    overridden = (text.partition("=")[0].strip() for text in config.option.override_ini or ())
    for key in (*in_file(config), *overridden):
        ours = key.lower().replace("-", "_")
        if ours.startswith("libero_max") and key not in known:
            raise pytest.UsageError(f"ini option {key}: unknown. {did_you_mean(ours, known)}")


def in_order(config: pytest.Config) -> bool:
    """Return True if pairs are to be handed out one by one, see :attr:`Settings.in_order`; known at once.

    Raises:
        pytest.UsageError: The order or the rule is not of its option's form.
    """
    values = {option.name: _value(config, option) for option in OPTIONS if option.name in ("order", "stop")}
    return values["stop"] is not None or bool(values["order"] and values["order"].seed is not None)


def policy_on_command_line(config: pytest.Config) -> bool:
    """Return True if the policy is named on the command line, which alone asks for the pairs."""
    return config.getoption("libero_max_policy") is not None


def on_command_line(config: pytest.Config) -> str:
    """Return the first of our options on the command line, as it is spelled there; empty without one."""
    given = (option.flag for option in OPTIONS if config.getoption(option.key) is not None)
    return next(given, "")


def policy_in_ini_file(config: pytest.Config) -> bool:
    """Return True if the policy is named in the ini file, which asks for the pairs only where collected."""
    return bool(ini_value(config, "libero_max_policy"))


def _value(config: pytest.Config, option: Option) -> Any:
    text, where = config.getoption(option.key), option.flag
    if text is None:
        text, where = ini_value(config, option.key), f"ini option {option.key}"
        if option.key in _OF_FILES and text:
            text = _beside_ini_file(config, text)
    if option.switch:
        return bool(text)
    if not text:
        return option.default if text is None or option.many else _parsed(option, text, where)
    if option.many:
        return tuple(_parsed(option, line, where) for line in text)
    return _parsed(option, text, where)


_OF_FILES = (
    "libero_max_policy",
    "libero_max_profile",
    "libero_max_manifest",
    "libero_max_program",
    "libero_max_latency",
)
"""Options whose value may be a file, or the folder of a run; from the ini file it is one beside that file."""


def _beside_ini_file(config: pytest.Config, text: str) -> str:
    """Return a value with the path from the working directory, if it names a file beside the ini file."""
    if config.inipath is None:
        return text
    if text.startswith(read.RECORDED):
        run = config.inipath.parent / Path(text.removeprefix(read.RECORDED)).expanduser()
        return f"{read.RECORDED}{os.path.relpath(run, config.invocation_params.dir)}"
    for ending in (".py", ".toml", ".json.gz", ".json"):
        begin, _, rest = text.rpartition(ending)
        file = config.inipath.parent / f"{begin}{ending}"
        if file.is_file():
            return f"{os.path.relpath(file, config.invocation_params.dir)}{rest}"
    return text


def gates_from(config: pytest.Config) -> Path:
    """Return the folder from which paths of runs in gates start: that of the ini file for the gates in it."""
    if config.getoption("libero_max_gate") or config.inipath is None:
        return config.invocation_params.dir
    return config.inipath.parent


def ini_value(config: pytest.Config, key: str) -> Any:
    """Return one of our values from the ini file: text, a list of texts, True or False; None if not there.

    Raises:
        pytest.UsageError: It has a type that the option does not have.
    """
    entry = in_file(config).get(key)
    if entry is not None and getattr(entry, "mode", "ini") == "toml":
        return native_value(key, entry.value, many=_OPTION_OF[key].many, switch=_OPTION_OF[key].switch)
    try:
        return config.getini(key)
    except (ValueError, pytest.UsageError) as error:  # which one depends on pytest's version
        raise pytest.UsageError(f"ini option {key}: {error}; expected true or false") from None


def _parsed(option: Option, text: str, where: str) -> Any:
    try:
        return option.parse(str(text))
    except (ValueError, LiberoMaxError) as error:
        value = f"{option.name}={text!r}"  # errors about a gate begin with it, and it is said once
        message = str(error)
        rest = message.removeprefix(value) if message.startswith(value) else f": {message}"
        raise pytest.UsageError(f"{where}={text!r}{rest}") from None


def _output(config: pytest.Config, text: str, resume: bool) -> Path:
    """Return the output folder; a number that is chosen is kept, because workers are given the options."""
    if text == "auto":
        made = sorted(config.invocation_params.dir.glob(f"{DEFAULT_OUTPUT}-[0-9][0-9][0-9][0-9]"))
        last = int(made[-1].name[-4:]) if made else 0
        text = f"{DEFAULT_OUTPUT}-{last + (not made or not resume):04d}"
        config.option.libero_max_output = text
    return _path(config, text)


def _path(config: pytest.Config, text: str) -> Path:
    """Return a path as given; reports write the home folder as ``~``, and their commands are to work."""
    return Path(config.invocation_params.dir, Path(text).expanduser())
