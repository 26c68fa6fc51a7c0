"""The studies by name, and from the header of a run."""

from __future__ import annotations

from typing import Any

from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.events.schedules import Cadence
from pytest_libero_max.studies.cadence import CadenceSweep, parse_cadence
from pytest_libero_max.studies.camera import CameraStrength, CameraTiming
from pytest_libero_max.studies.study import Study

_WITHOUT_SETTINGS = {study.name: study for study in (CameraTiming, CameraStrength)}
STUDIES: dict[str, type[Study]] = {**_WITHOUT_SETTINGS, CadenceSweep.name: CadenceSweep}
"""Every study by its name."""


def make_study(name: str, settings: tuple[Cadence, ...] | None = None) -> Study:
    """The study of that name.

    Args:
        name: A name of :data:`STUDIES`.
        settings: Of the cadence study, which needs them and is the only one that has them.

    Raises:
        OptionError: The settings are missing, or given to another study.
    """
    if name == CadenceSweep.name:
        if settings is None:
            raise OptionError(
                "The study cadence needs its settings. Add --libero-max-cadence=2,4,8 (Q), or "
                "--libero-max-cadence=2/2,4/4,8/8 (H/Q)."
            )
        return CadenceSweep(settings)
    if settings is not None:
        raise OptionError(
            f"--libero-max-cadence is for the study cadence, but the study is {name}. Take it away."
        )
    return _WITHOUT_SETTINGS[name]()


def study_from_dict(values: Any) -> Study:
    """Read what :meth:`.study.Study.to_dict` wrote.

    Raises:
        ReportError: It has another form, or is of a study that this version does not know.
    """
    try:
        name, settings = values["name"], values.get("settings")
        study = make_study(name, None if settings is None else parse_cadence(settings))
        if study.to_dict() != values:
            raise ValueError("it has other fields")
    except (AttributeError, KeyError, TypeError, ValueError, OptionError) as error:
        raise ReportError.seen(
            "study",
            values,
            f" of a run is none that this version knows ({error}). Read it with the version that played it.",
        ) from error
    return study
