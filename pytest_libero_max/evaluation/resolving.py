"""Settings from values that have been read: defaults that depend on others, and contradictions."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.latency import NO_LATENCY, Latency
from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.errors import LiberoMaxError, OptionError, ReportError
from pytest_libero_max.evaluation.processes.time_limits import Limits
from pytest_libero_max.evaluation.settings import DEFAULT_OUTPUT, Settings
from pytest_libero_max.runs.protocol import RECORDED_RUN
from pytest_libero_max.studies.registry import find_study
from pytest_libero_max.substrates.registry import SUBSTRATES

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.programs import Program
    from pytest_libero_max.studies.study import Study


def resolve(values: Mapping[str, Any], here: Path, given: Collection[str] = ()) -> Settings:
    """Return settings from values that have been read, in which options may contradict each other.

    Args:
        values: By the names of the fields; each is there, None where nothing was asked for.
        here: Folder that relative paths start from.
        given: Names of the settings that were asked for in so many words, and not by an ini file.

    Raises:
        OptionError: Two options contradict each other, or name what does not exist.
    """
    values = dict(values)
    if values["manifest"] is not None:
        if "track" in given:
            raise OptionError(
                "--libero-max-track and --libero-max-manifest both name the cases; give one of them."
            )
        values["manifest"] = path_from(here, values["manifest"])
    values["output"] = _output(values["output"], here, resume=values["resume"])
    if values["xfails"] is not None:
        values["xfails"] = path_from(here, values["xfails"])
    values["program"] = _program(values, here)
    values["libero"] = tuple(path_from(here, folder) for folder in values["libero"])
    if values["libero_assets"] is not None:
        values["libero_assets"] = path_from(here, values["libero_assets"])
    _check_substrate_options(given, values["substrate"].name)
    values["order"] = values["order"] or Order()
    values["study"] = _study(values, here)
    values["latency"] = _latency(values["latency"], here, SUBSTRATES[values["substrate"].name].control_hz)
    values["timeout"] = values["timeout"] or Limits()
    _check_timing(values)
    settings = Settings(**values)
    return replace(settings, track=_track(settings, values["track"]))


def _output(text: str, here: Path, *, resume: bool) -> Path:
    """Return the output folder."""
    if text == "auto":
        made = sorted(here.glob(f"{DEFAULT_OUTPUT}-[0-9][0-9][0-9][0-9]"))
        last = int(made[-1].name[-4:]) if made else 0
        text = f"{DEFAULT_OUTPUT}-{last + (not made or not resume):04d}"
    return path_from(here, text)


def path_from(here: Path, text: str | Path) -> Path:
    """Return a path as given; reports write the home folder as ``~``, and their commands are to work."""
    return Path(here, Path(text).expanduser())


def _check_timing(values: Mapping[str, Any]) -> None:
    """Check the options about when a policy is asked."""
    if values["latency"] != NO_LATENCY and "adaptive" in values["wrap"]:
        raise OptionError(
            f"--libero-max-latency={values['latency']} is of a policy that is asked every Q steps, but "
            f"--libero-max-wrap=adaptive:{values['wrap']['adaptive']} chooses when to ask. Leave one of them "
            "out."
        )
    horizon, interval = values["horizon"], values["query_interval"]
    if horizon is not None and interval is not None and interval > horizon:
        raise OptionError(
            f"--libero-max-query-interval={interval} > --libero-max-horizon={horizon}: a query returns "
            "at most H actions, so no more than H can be executed before the next (Q <= H). "
            "Lower Q or raise H."
        )


_SUBSTRATE_OPTIONS = {"libero": "installations", "libero-assets": "assets"}
"""The field of :class:`.SubstrateOptions` that an option fills, by the option's name."""


def _check_substrate_options(given: Collection[str], substrate: str) -> None:
    """Check that the substrate reads the options that are given for it."""
    for name, filled in _SUBSTRATE_OPTIONS.items():
        if name.replace("-", "_") in given and filled not in SUBSTRATES[substrate].reads:
            readers = [kind.name for kind in SUBSTRATES.values() if filled in kind.reads]
            raise OptionError(
                f"--libero-max-{name} is for the {' or '.join(readers)} substrate, but the substrate is "
                f"{substrate}. Add --libero-max-substrate={readers[0]}."
            )


def _track(settings: Settings, name: str | None) -> str:
    from pytest_libero_max.evaluation.case_support import supported_track

    if settings.manifest is not None:
        return name or ""
    return supported_track(name, settings.substrate.name, settings.substrate_options)


def _study(values: dict[str, Any], here: Path) -> Study | None:
    """Return the study that is asked for; the track becomes that of the study where none is named."""
    if values["study"] is None:
        return None
    study = find_study(values["study"], here)
    varies = {key for arm in study.spelled for key in arm}
    if varies & {"cadence", "latency"}:
        _require_fixed_cadence(values, f"study={study.name}")
    if "latency" in varies and values["latency"] not in (None, NO_LATENCY):
        raise OptionError(
            f"--libero-max-study={study.name} plays delays of its own, but "
            f"--libero-max-latency={values['latency']} is given. Leave one of the two out."
        )
    if study.scales and values["strength"] != 1.0:
        raise OptionError(
            f"--libero-max-study={study.name} plays the event at strengths of its own, but "
            f"--libero-max-strength={values['strength']:g} is given. Leave one of the two out."
        )
    if values["track"] is None:
        values["track"] = study.track
    return study


def _require_fixed_cadence(values: Mapping[str, Any], option: str) -> None:
    """Check that nothing but the arms of a study or program decides when a policy is asked."""
    if "adaptive" in values["wrap"]:
        raise OptionError(
            f"--libero-max-{option} varies when the policy is asked or answers, but "
            f"--libero-max-wrap=adaptive:{values['wrap']['adaptive']} chooses when to ask. Leave one of them "
            "out."
        )


def _latency(value: Latency | str | None, here: Path, hz: int) -> Latency:
    """Return the time that a query takes; ``recorded:RUN`` reads it from the records of a run."""
    if not isinstance(value, str):
        return value or NO_LATENCY
    from pytest_libero_max.runs.query_times import recorded_latency

    if not value.startswith(RECORDED_RUN):
        return _checked_latency(value, hz)
    folder = value.removeprefix(RECORDED_RUN)
    waits = folder.endswith(",sync")
    try:
        path = path_from(here, folder.removesuffix(",sync"))
        return recorded_latency(path, hz, "sync" if waits else "async")
    except ReportError as error:
        raise OptionError(
            f"--libero-max-latency={value!r}: expected the folder of a run behind {RECORDED_RUN!r}; {error}"
        ) from None


def _checked_latency(text: str, hz: int) -> Latency:
    try:
        return Latency.parse(text, hz)
    except ValueError as error:
        raise OptionError(f"--libero-max-latency={text!r}: {error}.") from None


def _program(values: Mapping[str, Any], here: Path) -> Program | None:
    """Return the program that is named."""
    if values["program"] is None:
        return None
    from pytest_libero_max.benchmark.programs import find_program

    if values["study"] is not None:
        raise OptionError(
            f"--libero-max-study={values['study']} plays its arms beside Base and Dynamic of the event, but "
            "--libero-max-program chooses the arms. Leave one of the two out."
        )
    with about("--libero-max-program: "):
        program = find_program(values["program"], here)
    if program.varies("cadence") or program.varies("latency"):
        _require_fixed_cadence(values, f"program={program.name}")
    return program


@contextmanager
def about(begin: str) -> Iterator[None]:
    """Let the message of an error in the block begin with these words.

    Raises:
        OptionError: An error of this package was raised in the block.
    """
    try:
        yield
    except LiberoMaxError as error:
        raise OptionError(f"{begin}{error}") from None
