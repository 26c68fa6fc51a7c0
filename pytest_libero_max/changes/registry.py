"""Registry of changes by the operation names of manifests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Protocol, cast

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.changes.camera import OrbitCamera, PlaceCamera, ShiftCamera
from pytest_libero_max.changes.change import Change
from pytest_libero_max.changes.inputs import FreezeImages, HideInputs, SwapImages
from pytest_libero_max.changes.instruction import (
    CancelInstruction,
    ReplaceInstruction,
    SetInstruction,
    SetTask,
)
from pytest_libero_max.changes.light import SetLamps, SetLighting
from pytest_libero_max.changes.material import CoverEntity, SetTexture, SetVisualTheme
from pytest_libero_max.changes.nothing import DelayAnswers, Nothing, ReseedPolicy
from pytest_libero_max.changes.pixels import CorruptPicture, SetGlare, SetSensorCorruption
from pytest_libero_max.changes.poses import (
    BumpObject,
    InsertDistractors,
    InsertObstacle,
    MoveObject,
    PutObject,
    RemoveObject,
    TurnObject,
)
from pytest_libero_max.changes.robot import OffsetArm, OpenGripper
from pytest_libero_max.errors import ChangeError, ManifestError, did_you_mean
from pytest_libero_max.registry import Registry, given

_KINDS = (
    SetLighting,
    ShiftCamera,
    SetVisualTheme,
    SetSensorCorruption,
    MoveObject,
    RemoveObject,
    InsertDistractors,
    InsertObstacle,
    Nothing,
    ReseedPolicy,
    # What only source variations use.
    OrbitCamera,
    PlaceCamera,
    OffsetArm,
    SetLamps,
    SetTexture,
    CoverEntity,
    CorruptPicture,
    SetGlare,
    PutObject,
    TurnObject,
    SetInstruction,
    SetTask,
    # What only the audit and programs use.
    HideInputs,
    FreezeImages,
    SwapImages,
    OpenGripper,
    BumpObject,
    DelayAnswers,
    # What the authors' pairs that are scored by intent use.
    ReplaceInstruction,
    CancelInstruction,
)


class ChangeType(Protocol):
    """A class of changes, registered under the name of its operation."""

    operation: ClassVar[str]

    def from_dict(self, raw: Mapping[str, Any]) -> Change:
        """Build the change from its manifest object, ``operation`` included; refuse invalid values."""


def _accept(name: str, candidate: object) -> ChangeType:
    for method in ("from_dict", "apply", "scaled", "reverted", "to_dict"):
        if not callable(getattr(candidate, method, None)):
            raise ValueError(
                f"{candidate!r} has no {method}(): a change follows pytest_libero_max.changes.change.Change; "
                "pytest_libero_max.changes.fields.ManifestFields offers from_dict() and to_dict()"
            )
    return cast(ChangeType, candidate)


OPERATIONS: Registry[ChangeType] = Registry(
    "operation",
    "pytest_libero_max.changes",
    given("operation", *_KINDS),
    _accept,
    ChangeError,
    attribute="operation",
)
"""Every operation a manifest may name: this package's, then those that installed packages add."""


def change_from_dict(raw: Mapping[str, Any]) -> Change:
    """Build a change from its manifest object; ``change_from_dict(x).to_dict() == x``.

    Raises:
        ChangeError: The operation or a field is unknown, a field is missing, or a value breaks its rule.
    """
    if not isinstance(raw, Mapping):
        raise ChangeError.seen("change", raw, ", but must be an object with an operation and its parameters.")
    operation = raw.get("operation")
    if not isinstance(operation, str) or operation not in OPERATIONS:
        raise ChangeError.seen(
            "operation", operation, f" is not a change. {did_you_mean(str(operation), OPERATIONS)}"
        )
    return OPERATIONS[operation].from_dict(raw)


def check_changes(cases: Iterable[Case]) -> None:
    """Build every change and setup of the cases once, to find out before anything is played.

    Raises:
        ManifestError: One of them is malformed; names the case.
    """
    for case in cases:
        for raw in (case.event.change, *case.event.setup):
            try:
                change_from_dict(raw)
            except ChangeError as error:
                raise ManifestError(
                    f"case {case.case_id!r}: {error}", field=error.field, value=error.value
                ) from error
