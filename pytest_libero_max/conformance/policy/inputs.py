"""Rules for inputs: what an answer depends on, and the images and the state that a model is given."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from pytest_libero_max.conformance.policy.contract import ANSWERS
from pytest_libero_max.conformance.policy.determinism import not_repeatable
from pytest_libero_max.conformance.policy.subject import PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.policies.model_inputs import INPUTS, USUAL, Inputs

ANYTHING = "policy/inputs/any"
_ANOTHER_TASK = "turn off the light and close the door"


def _ignored(subject: PolicySubject) -> frozenset[str]:
    """Return the names of the changes after which the first answer of an episode stays the same."""
    subject.start()
    first, ignored = subject.ask(0), set()
    for name, change in _changes(subject).items():
        subject.start()
        if subject.ask(0, **change).tobytes() == first.tobytes():
            ignored.add(name)
    return frozenset(ignored)


def _changes(subject: PolicySubject) -> dict[str, dict[str, Any]]:
    """Return everything that is changed of what is shown, each by its name."""
    return _state(subject) | _INSTRUCTION | _images(subject)


def _images(subject: PolicySubject) -> dict[str, dict[str, Any]]:
    """Return each image in negative, by its name."""
    shown = subject.shown.observations[0]
    return {name: {"observation": {name: 255 - shown[name]}} for name in shown if name.endswith("_image")}


def _state(subject: PolicySubject) -> dict[str, dict[str, Any]]:
    """Return the state of another observation."""
    another = subject.shown.observations[2]
    rest = {name: value for name, value in another.items() if not name.endswith("_image")}
    return {"the state": {"observation": rest}}


_INSTRUCTION = {"the instruction": {"instruction": _ANOTHER_TASK}}


def _unexamined(subject: PolicySubject) -> Finding | None:
    if subject.policy.spec.privileged:
        return unexamined("the policy reads the simulator (privileged)")
    return not_repeatable(subject)


@rule(ANYTHING, "must", needs=ANSWERS)
def anything(subject: PolicySubject) -> Finding:
    """Answer to what is shown."""
    if reason := _unexamined(subject):
        return reason
    if len(subject.once(_ignored)) < len(_changes(subject)):
        return kept("the answer changes with what is shown")
    return broken(
        "the answer stays the same whatever is shown",
        "an answer to the observation",
        "An old chunk is returned, or the model is not asked.",
    )


def _each(subject: PolicySubject, names: Collection[str]) -> Finding:
    if reason := _unexamined(subject):
        return reason
    if not names:
        return unexamined("the policy asks for no images")
    if ignored := [name for name in names if name in subject.once(_ignored)]:
        return broken(
            f"the answer does not depend on {', '.join(ignored)}",
            f"an answer that changes with {', '.join(names)}",
            "If the model reads it, it does not arrive there.",
        )
    return kept(f"the answer depends on {', '.join(names)}")


@rule("policy/inputs/images", "should", needs=ANYTHING)
def images(subject: PolicySubject) -> Finding:
    """Let the answer depend on every image."""
    return _each(subject, _images(subject))


@rule("policy/inputs/instruction", "should", needs=ANYTHING)
def instruction(subject: PolicySubject) -> Finding:
    """Let the answer depend on the instruction."""
    return _each(subject, _INSTRUCTION)


@rule("policy/inputs/state", "note", needs=ANYTHING)
def state(subject: PolicySubject) -> Finding:
    """Let the answer depend on the state. Many models have none."""
    return _each(subject, _state(subject))


_SILENT = unexamined(
    f"{', '.join(INPUTS)}: the policy does not tell what its model is shown",
    "Offer model_inputs(observation, query), a mapping of names to the arrays that predict hands to the "
    "model.",
)


def _recognised(subject: PolicySubject) -> tuple[Inputs, list[Finding]]:
    """Return the inputs, and findings on the images that were not recognised among them."""
    inputs = subject.inputs
    if inputs is None:
        return Inputs(), [_SILENT]
    unknown = [
        unexamined("is like no camera's image in any orientation, nor a part of one", part=f"input {name!r}")
        for name in inputs.unrecognised
    ]
    missing = [
        unexamined(f"no image of {camera} was recognised among {', '.join(inputs.names)}")
        for camera in inputs.missing
    ]
    return inputs, unknown + missing


@rule("policy/images/colours", "must", needs=ANSWERS)
def colours(subject: PolicySubject) -> Iterator[Finding]:
    """Give the model RGB, as the world delivers it."""
    inputs, unrecognised = _recognised(subject)
    yield from unrecognised
    for image in inputs.images:
        swapped = image.view.reversed_colours
        yield judged(
            not swapped,
            "has blue and red exchanged" if swapped else "is RGB",
            "RGB, as the world delivers it",
            "OpenCV reads and writes BGR: turn the channels with [:, :, ::-1].",
            part=f"input {image.name!r}",
        )


@rule("policy/images/cameras", "must", needs=ANSWERS)
def cameras(subject: PolicySubject) -> Iterator[Finding]:
    """Give each input the image of the camera that its name or place stands for."""
    inputs, unrecognised = _recognised(subject)
    yield from unrecognised
    for image in inputs.images:
        yield judged(
            image.meant in (None, image.view.camera),
            f"is the image of {image.view.camera}",
            f"that of {image.meant}, by its name or place",
            "The two cameras may be exchanged.",
            part=f"input {image.name!r}",
        )


@rule("policy/images/rotated", "should", needs=ANSWERS)
def rotated(subject: PolicySubject) -> Iterator[Finding]:
    """Rotate images by 180 degrees, unless the model was trained otherwise."""
    inputs, unrecognised = _recognised(subject)
    yield from unrecognised
    for image in inputs.images:
        view, part = image.view, f"input {image.name!r}"
        if view.turn == USUAL:
            yield kept(f"{view.camera}, {view.turn}{'' if view.whole else ', a part of it'}", part=part)
        else:
            yield broken(
                f"is {view.turn}",
                f"{USUAL}, unless the model was trained otherwise",
                "If its own evaluation code turns images by [::-1, ::-1], do so too: no error tells.",
                part=part,
            )


@rule("policy/state/order", "must", needs=ANSWERS)
def quaternion_order(subject: PolicySubject) -> Iterator[Finding]:
    """Read the quaternion as x, y, z, w."""
    return _states(subject, {"misread": ("x, y, z, w", "robot0_eef_quat has w last.")})


@rule("policy/state/form", "should", needs=ANSWERS)
def orientation_form(subject: PolicySubject) -> Iterator[Finding]:
    """Write the orientation as robosuite does, unless the model was trained otherwise."""
    wrong = {
        "antipodal": (
            "the sign kept, as robosuite has it, unless the model was trained otherwise",
            "pytest_libero_max.transforms.axis_angle keeps it.",
        ),
        "w_first": (
            "x, y, z, w, as LIBERO delivers it, unless the model was trained otherwise",
            "robot0_eef_quat has w last.",
        ),
    }
    return _states(subject, wrong)


def _states(subject: PolicySubject, wrong: Mapping[str, tuple[str, str]]) -> Iterator[Finding]:
    """Yield a finding for each orientation among the inputs; wrong verdicts have a rule and a cure."""
    inputs = subject.inputs
    if inputs is None:
        yield _SILENT
    elif not inputs.states:
        names = ", ".join(inputs.names)
        yield unexamined(f"the orientation of the hand was recognised in none of {names}")
    else:
        for state in inputs.states:
            expected, cure = wrong.get(state.verdict, ("", ""))
            yield judged(not expected, state.form, expected, cure, part=f"input {state.name!r}")
