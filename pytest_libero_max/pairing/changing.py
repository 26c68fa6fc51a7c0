"""Actions on a world between its steps: the beginning of a case, and a change with its measured effect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes.change import Change, Evidence
from pytest_libero_max.changes.nothing import Nothing
from pytest_libero_max.changes.registry import change_from_dict
from pytest_libero_max.errors import ProtocolError
from pytest_libero_max.pairing.kept_images import KeptImages
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.worlds.contract import Control, World, alterable


def begin_world(case: Case, world: World, control: Control = "delta") -> None:
    """Reset to the case's initial state, apply the setup that all arms share, settle for ten no-op steps.

    Args:
        control: Meaning of the actions after the settle steps.

    Raises:
        SubstrateError: The scene has no such initial state.
        ChangeError: The setup does not fit this world.
        SimulatorError: The scene does not settle.
    """
    world.reset(case.init_state_index)
    for change in case.event.setup:
        change_from_dict(change).apply(alterable(world))
    for _ in range(SETTLE_STEPS):
        world.step(world.robot.noop)
    world.set_control(control)


@dataclass(frozen=True)
class Applied:
    """A change that has happened."""

    change: Change
    evidence: Evidence
    """Values that it touches, before and after."""
    pixel_change: dict[str, float]
    """For each camera that was looked through, the mean absolute difference of its images before and after, 0
    to 255."""

    def to_dict(self) -> Json:
        """Return the evidence and the change of pixels as JSON values."""
        return {**self.evidence.to_dict(), "pixel_change": dict(self.pixel_change)}


def apply_change(
    change: Change,
    world: World,
    spec: PolicySpec | None,
    item_id: str,
    images: KeptImages | None = None,
) -> Applied:
    """Apply a change to the world now, once, and measure its effect, or raise ProtocolError or ChangeError.

    Args:
        spec: Policy spec with the cameras in which to measure the change of pixels; None to render nothing.
        images: Images of this world that are kept, so that none is drawn again.
    """
    if isinstance(change, Nothing):
        cameras = spec.cameras if spec else ()
        return Applied(change, change.apply(alterable(world)), dict.fromkeys(cameras, 0.0))
    cameras, size = (spec.cameras, spec.image_size) if spec else ((), 1)
    kept = KeptImages() if images is None else images
    shown = kept.observe(world, cameras, size)
    before = world.digest()
    evidence = change.apply(alterable(world))
    if world.digest() == before:
        raise ProtocolError(
            f"{item_id}: {change.operation} left the world bit for bit as it was, so the arm would equal the "
            "one without it. Its parameters describe no change; repair the manifest."
        )
    after = kept.observe(world, cameras, size)
    names = {camera: f"{camera}_image" for camera in cameras}
    return Applied(
        change,
        evidence,
        {
            camera: float(np.abs(after[name].astype(np.int16) - shown[name]).mean())
            for camera, name in names.items()
        },
    )
