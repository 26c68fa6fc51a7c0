"""The studies by name, and from the header of a run."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.registry import Registry

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.latency import Latency
    from pytest_libero_max.events.schedules import Cadence
    from pytest_libero_max.studies.study import Study

_CADENCE = "cadence"
_LATENCY = "latency"
_REPEATS = "repeats"

_OWN = {
    "camera-timing": "camera_study:CameraTiming",
    "camera-strength": "camera_study:CameraStrength",
    "event-timing": "event_timing:EventTiming",
    "audit": "audit:Audit",
    _REPEATS: "repeats:Repeats",
    _CADENCE: "cadence_sweep:CadenceSweep",
    _LATENCY: "latency_sweep:LatencySweep",
}
_NAME = re.compile(r"[a-z][a-z0-9-]*")


def _load(name: str) -> type[Study]:
    module, _, found = _OWN[name].partition(":")
    return _accept(name, getattr(importlib.import_module(f"pytest_libero_max.studies.{module}"), found))


def _accept(name: str, found: object) -> type[Study]:
    """Return the study that was registered under a name.

    Raises:
        ValueError: It is none, or one of its attributes breaks a rule.
    """
    from pytest_libero_max.studies.study import Study

    if not (isinstance(found, type) and issubclass(found, Study)) or inspect.isabstract(found):
        raise ValueError(f"{found!r} is not a subclass of pytest_libero_max.Study with arms()")
    if getattr(found, "name", None) != name or not _NAME.fullmatch(name):
        raise ValueError(
            f"name={getattr(found, 'name', None)!r}, but it is registered as {name!r}; both must be the same "
            "word of lower-case letters, digits and hyphens"
        )
    for attribute in ("title", "track"):
        if not isinstance(getattr(found, attribute, None), str):
            raise ValueError(f"{found.__name__} lacks {attribute}")
    return found


def _own() -> Mapping[str, Callable[[], type[Study]]]:
    return {name: partial(_load, name) for name in _OWN}


STUDIES: Registry[type[Study]] = Registry("study", "pytest_libero_max.studies", _own, _accept, OptionError)
"""Every study by its name: this package's, then those that installed packages add."""


def make_study(
    name: str,
    settings: tuple[Cadence, ...] | None = None,
    delays: tuple[Latency, ...] | None = None,
    plays: int | None = None,
) -> Study:
    """Return the study of that name.

    Args:
        name: A name of :data:`STUDIES`.
        settings: Of the study cadence, which needs them and is the only one that has them.
        delays: Of the study latency, likewise.
        plays: Number of plays of each case in the study repeats, which has a usual one.

    Raises:
        OptionError: Settings are missing, are given to another study, or break a rule.
    """
    if plays is not None:
        if name != _REPEATS:
            raise OptionError(
                f"--libero-max-repeats is the study {_REPEATS}, but the study is {name}. Take one away."
            )
        from pytest_libero_max.studies.repeats import Repeats

        return Repeats(plays)
    for swept, given, flag, example in (
        (_CADENCE, settings, "--libero-max-cadence", "2,4,8 (Q), or --libero-max-cadence=2/2,4/4,8/8 (H/Q)"),
        (_LATENCY, delays, "--libero-max-delays", "1,2,4,8 (control steps)"),
    ):
        if name == swept and given is None:
            raise OptionError(f"The study {name} needs its settings. Add {flag}={example}.")
        if name != swept and given is not None:
            raise OptionError(f"{flag} is for the study {swept}, but the study is {name}. Take it away.")
    if settings is not None:
        from pytest_libero_max.studies.cadence_sweep import CadenceSweep

        return CadenceSweep(settings)
    if delays is not None:
        from pytest_libero_max.studies.latency_sweep import LatencySweep

        return LatencySweep(delays)
    return STUDIES[name]()


def study_from_dict(values: Any) -> Study:
    """Read what :meth:`.study.Study.to_dict` wrote.

    Raises:
        ReportError: It has another form, or is of a study that this version does not know.
    """
    from pytest_libero_max.studies.cadence_sweep import parse_cadence
    from pytest_libero_max.studies.latency_sweep import parse_delays

    try:
        name, settings = values["name"], values.get("settings")
        if settings is None:
            study = make_study(name)
        elif name == _LATENCY:
            study = make_study(name, delays=parse_delays(settings))
        elif name == _REPEATS:
            study = make_study(name, plays=int(settings))
        else:
            study = make_study(name, parse_cadence(settings))
        if study.to_dict() != values:
            raise ValueError("it has other fields")
    except (AttributeError, KeyError, TypeError, ValueError, OptionError) as error:
        raise ReportError.seen(
            "study",
            values,
            f" of a run is none that this version knows ({error}). Read it with the version and the "
            "packages that played it.",
        ) from error
    return study
