"""The studies by name, and from the header of a run."""

from __future__ import annotations

import inspect
import re
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.registry import Registry, references

if TYPE_CHECKING:
    from pytest_libero_max.studies.study import Study

_OWN = MappingProxyType(
    {
        "camera-timing": "camera_study:CameraTiming",
        "camera-strength": "camera_study:CameraStrength",
        "event-timing": "event_timing:EventTiming",
        "cadence": "cadence_sweep:CadenceSweep",
        "latency": "latency_sweep:LatencySweep",
    }
)

_NAME = re.compile(r"[a-z][a-z0-9-]*")


def _accept(name: str, found: object) -> type[Study]:
    """Return the study that was registered under a name.

    Raises:
        ValueError: It is none, or one of its attributes breaks a rule.
    """
    from pytest_libero_max.studies.study import Study

    if not (isinstance(found, type) and issubclass(found, Study)) or inspect.isabstract(found):
        raise ValueError(f"{found!r} is not a subclass of pytest_libero_max.Study with arms()")
    if not _NAME.fullmatch(name):
        raise ValueError(f"name={name!r}, but must be a word of lower-case letters, digits and hyphens")
    for attribute in ("title", "track"):
        if not isinstance(getattr(found, attribute, None), str):
            raise ValueError(f"{found.__name__} lacks {attribute}")
    return found


STUDIES: Registry[type[Study]] = Registry(
    "study",
    "pytest_libero_max.studies",
    references("pytest_libero_max.studies", lambda: _OWN),
    _accept,
    OptionError,
    attribute="name",
)
"""Every study by its name: this package's, then those that installed packages add."""


def study_from_dict(values: Any) -> Study:
    """Read what :meth:`.study.Study.to_dict` wrote.

    Raises:
        ReportError: It has another form, or is of a study that this version does not know.
    """
    try:
        study = STUDIES[values["name"]].of(values.get("settings"))
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
