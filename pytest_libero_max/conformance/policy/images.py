"""Rules for the images and the state that a model is given, of a policy that offers ``model_inputs``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pytest_libero_max.conformance.policy.contract import ANSWERS
from pytest_libero_max.conformance.policy.subject import PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.policies.model_inputs import INPUTS, USUAL, Inputs

_SILENT = unexamined(
    f"{', '.join(INPUTS)}: the policy does not tell what its model is shown",
    "Offer model_inputs(observation, query), a mapping of names to the arrays that predict hands to the "
    "model.",
)


def _images(subject: PolicySubject) -> tuple[Inputs, list[Finding]]:
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
    inputs, unrecognised = _images(subject)
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
    inputs, unrecognised = _images(subject)
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
    inputs, unrecognised = _images(subject)
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
