"""Everything about one case, for people: in words, and as pictures of its event."""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from pathlib import Path

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.certificates import Certificate, Ending
from pytest_libero_max.changes.registry import change_from_dict
from pytest_libero_max.errors import LiberoMaxError, OptionError, counted
from pytest_libero_max.events.approach import approach, proximity_of
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import arms_of, trigger_of
from pytest_libero_max.events.triggers import Proximity
from pytest_libero_max.policies.transforms.images import png_file
from pytest_libero_max.report.writers.report_files import make_folder, write_bytes
from pytest_libero_max.substrates.registry import contents_of, own_variation
from pytest_libero_max.substrates.variation import variation_metadata
from pytest_libero_max.worlds.contract import Image, World, alterable

_ENDINGS: Mapping[Ending, str] = {
    "solved": "completes Dynamic",
    "not_triggered": "does not come near the trigger entity",
    "base_unsolved": "completes neither Dynamic nor Base",
    "unsolved": "completes Base and does not complete Dynamic",
}


def case_lines(case: Case, certificates: Mapping[str, Certificate]) -> list[str]:
    """Return the lines of a case: description, event, command to play it alone, object in the manifest."""
    kind = EVENTS[case.event.name]
    setup = ", ".join(change["operation"] for change in case.event.setup)
    return [
        f"{case.case_id}: {case.event.name}, variant {case.event.variant}, near {case.event.entity}",
        f"{case.source} {case.source_category}, {case.suite} task {case.task_index}, "
        f"initial state {case.init_state_index}, digest {case.digest}",
        "",
        f"Instruction: {_instruction(case)}",
        f"Scene: {_scene(case)}",
        f"Before it begins, in both arms: {setup or 'nothing'}",
        f"Event: {_first_paragraph(type(kind).__doc__)}",
        f"Family {kind.family}, severity {case.event.severity}",
        f"When: {_when(case)}",
        *([] if case.program is None else [f"Program {case.program.name}: arms {_arms(case)}"]),
        f"Expected of a policy: {kind.expected}",
        f"Episode: at most {case.budget} steps, policy seed {case.policy_seed}",
        f"Certificate: {_certificate(certificates.get(case.case_id))}",
        f"Play it alone with -k {case.item_id}",
        "",
        *json.dumps(case.record, indent=2, sort_keys=True).splitlines(),
    ]


def _when(case: Case) -> str:
    """Return the moment of the event in words."""
    trigger = trigger_of(case)
    if isinstance(trigger, Proximity):
        return f"at the first step after which the hand is within {trigger.distance_m} m of {trigger.entity}"
    return json.dumps(case.event.trigger, sort_keys=True)


def _arms(case: Case) -> str:
    """Return the arms of a case with the number of entries of each."""
    return ", ".join(f"{arm.name} ({len(arm.schedule)})" for arm in arms_of(case))


def event_pictures(world: World, case: Case, size: int) -> dict[str, tuple[Image, Image]]:
    """Apply the event to the world now, and return each camera's image just before and just after.

    Returns:
        Two (size, size, 3) uint8 images by camera, upright.
    """
    cameras = world.robot.cameras
    before = world.observe(cameras, size)
    change_from_dict(case.event.change).apply(alterable(world))
    after = world.observe(cameras, size)
    return {camera: (before[f"{camera}_image"][::-1], after[f"{camera}_image"][::-1]) for camera in cameras}


def write_event_pictures(folder: Path, world: World, case: Case, size: int) -> list[Path]:
    """Write ``<item id>--<camera>-before.png`` and ``-after.png`` for each camera.

    Nobody plays: the hand goes to the trigger entity on a fixed way.
    """
    paths = {
        (camera, when): folder / f"{case.item_id}--{camera}-{when}.png"
        for camera in world.robot.cameras
        for when in ("before", "after")
    }
    for path in paths.values():
        if path.exists():
            raise OptionError(f"{path} exists. Remove it or give another folder.")
    if approach(world, case) is None:
        raise OptionError(
            f"{case.item_id}: the hand does not come within {proximity_of(case).distance_m} m of "
            f"{case.event.entity} on any fixed way. Film a pair of it with "
            "libero-max film."
        )
    seen = event_pictures(world, case, size)
    make_folder(folder)
    for camera, pictures in seen.items():
        for when, picture in zip(("before", "after"), pictures, strict=True):
            write_bytes(paths[camera, when], png_file(picture))
    return list(paths.values())


def _instruction(case: Case) -> str:
    if case.instruction is not None:
        return f"{case.instruction} (as the manifest says)"
    try:
        if case.unmodified:
            return f"{contents_of(case.suite, case.task_index).language} (the task's own)"
        return f"{variation_metadata(own_variation(case)).language} (the variation's own)"
    except LiberoMaxError:
        return "the task's own"


def _scene(case: Case) -> str:
    if case.unmodified:
        return "unmodified"
    try:
        variation = own_variation(case)
    except LiberoMaxError as error:
        return f"not an embedded one: {error}"
    parts = [f"{name} {json.dumps(value)}" for name, value in variation.scene.items()]
    parts += [json.dumps(change) for change in variation.changes]
    return f"{variation.key}, {variation.kind}: {'; '.join(parts) or 'as in LIBERO'}"


def _certificate(found: Certificate | None) -> str:
    if found is None:
        return "none, since the expert has not played this case"
    if found.ending == "not_triggered":
        return f"the expert {_ENDINGS[found.ending]}"
    how = (
        f"event after {counted(found.trigger_step or 0, 'step')}, {counted(found.steps or 0, 'step')} in all"
    )
    return f"the expert {_ENDINGS[found.ending]} ({how})"


def _first_paragraph(text: str | None) -> str:
    return inspect.cleandoc(text or "").split("\n\n")[0].replace("\n", " ")
