"""Rules of the contract of environments: opening, observations, steps, closing, time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pytest_libero_max.conformance.environment.subject import (
    EnvironmentSubject,
    Reading,
    copied,
    differing,
    images_of,
    settled,
)
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.errors import SubstrateError, counted
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION

OPENS = "env/contract/opens"
KEYS = "env/contract/keys"
SAME = "env/repeats/same"
GRIPPER = "env/actions/gripper"
QUATERNION = "env/states/quaternion"
RESTS = "env/actions/rest"

_SHAPES = {"position": (3,), "quaternion": (4,), "gripper": (2,), "state": (8,)}


@rule(OPENS, "must")
def opens(subject: EnvironmentSubject) -> Finding:
    """Open, begin an episode, and play a step."""
    reading = subject.start()
    subject.step(NOOP_ACTION)
    kind = "a vector of environments" if subject.is_vector else type(subject.environment).__name__
    return kept(f"{kind} as {subject.reference.task}, with {', '.join(reading) or 'nothing that is known'}")


@rule(KEYS, "must", needs=OPENS)
def keys(subject: EnvironmentSubject) -> Finding:
    """Observe both cameras' images, and the hand's position, orientation and fingers."""
    reading = subject.start()
    wrong = [*_wrong_images(reading), *_wrong_values(reading)]
    if wrong:
        return broken(
            ", ".join(wrong),
            "images (H, W, 3) uint8; position (3,), quaternion (4,), gripper (2,) or state (8,)",
            "Declare where they are: DeclaredEnvironment(keys={ROLE: KEY}), with / between levels.",
        )
    sizes = ", ".join(f"{camera} {image.shape}" for camera, image in images_of(reading).items())
    return kept(f"{sizes}, and the robot's state")


def _wrong_images(reading: Reading) -> Iterator[str]:
    for camera in CAMERAS:
        image = reading.get(camera)
        if image is None:
            yield f"no image of {camera}"
        elif image.ndim != 3 or image.shape[2] != 3 or min(image.shape[:2]) < 32 or image.dtype != np.uint8:
            yield f"{camera} {image.shape} {image.dtype}"


def _wrong_values(reading: Reading) -> Iterator[str]:
    roles = ("state",) if "state" in reading else ("position", "quaternion", "gripper")
    for role in dict.fromkeys((*roles, *(role for role in _SHAPES if role in reading))):
        value = reading.get(role)
        if value is None:
            yield f"no {role}"
        elif np.shape(value) != _SHAPES[role] or not np.isfinite(value).all():
            yield f"{role} {np.shape(value)}{'' if np.isfinite(value).all() else ' not finite'}"


@rule("env/contract/steps", "must", needs=OPENS)
def steps(subject: EnvironmentSubject) -> Finding:
    """Return from a step a number as reward, and flags that are true or false."""
    subject.start()
    played = subject.step(NOOP_ACTION)
    try:
        reward = float(played.reward)
    except (TypeError, ValueError):
        return broken(f"reward={played.reward!r}", "a number", "Return a float.")
    return kept(f"{played.fields} values, reward {reward:g}")


@rule("env/contract/aliases", "must", needs=KEYS)
def aliases(subject: EnvironmentSubject) -> Finding:
    """Return observations that later steps leave as they are."""
    reading = subject.start()
    before = copied(reading)
    for _ in range(3):
        subject.step((0.5, 0.5, -0.5, 0.0, 0.0, 0.0, -1.0))
    changed = [role for role, value in before.items() if not np.array_equal(value, reading[role])]
    if not changed:
        return kept("an observation stays as it was while the episode goes on")
    return broken(
        f"{', '.join(changed)} of an observation changed with later steps",
        "copies",
        "Copy what step() returns.",
    )


@rule("env/contract/close", "should", needs=OPENS)
def closes(subject: EnvironmentSubject) -> Finding:
    """Close in the middle of an episode, and be closed twice."""
    neighbour = subject.another()
    neighbour.start()
    neighbour.step(NOOP_ACTION)
    environment = neighbour.environment
    try:
        for _ in range(2):
            environment.close()
    except Exception as error:  # an environment of others may raise anything
        return broken(
            f"the second close() raised {type(error).__name__}: {error}",
            "nothing to happen",
            "Return where it is closed already: a cleanup after an error closes twice.",
        )
    else:
        return kept("close() may be called twice, in the middle of an episode")
    finally:
        subject.abandon()  # closing may have taken the renderer of the others with it


@rule("env/contract/reopens", "must", needs=SAME)
def reopens(subject: EnvironmentSubject) -> Finding:
    """Begin as before in an environment that is opened after another was closed."""
    first = subject.once(settled)
    subject.abandon()
    parts = differing(first, subject.begin(drawn=True))
    if not parts:
        return kept("an environment that is opened again begins in the same bits")
    return broken(
        f"opened again, it begins with another {', '.join(parts)}",
        "the same observation of the same initial state",
        "Seed before each reset: LIBERO draws its fixtures' places from numpy's global generator.",
    )


@rule("env/contract/company", "must", needs=SAME)
def company(subject: EnvironmentSubject) -> Finding:
    """Show the same images while another environment of the process is opened, played and closed."""
    alone = _episode(subject)
    shown = _episode(subject, subject.another())
    subject.abandon()
    for when, (first, second) in zip(("open", "closed"), zip(alone, shown, strict=True), strict=True):
        parts = [part for part in differing(images_of(first), images_of(second)) if part]
        if parts:
            return broken(
                f"while another is {when}: {', '.join(parts)}",
                "the images of an environment alone",
                "Make its own GL context current before drawing, or open one environment a process.",
            )
    return kept("another environment of the same process leaves the images as they are")


def _episode(
    subject: EnvironmentSubject, neighbour: EnvironmentSubject | None = None
) -> tuple[Reading, Reading]:
    """Return an observation while the neighbour is open, and one after it was closed."""
    subject.begin(drawn=True)
    if neighbour is not None:
        neighbour.start()
        neighbour.step((1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0))
    first = copied(subject.step(NOOP_ACTION).reading)
    if neighbour is not None:
        neighbour.abandon()
    try:
        return first, subject.step(NOOP_ACTION).reading
    except SubstrateError:
        return first, {}


RATE = "env/clock/rate"

_STEPS = 5


@rule(RATE, "must", needs=KEYS)
def control_rate(subject: EnvironmentSubject) -> Finding:
    """Advance the simulator by 50 ms in a step."""
    subject.start()
    before = subject.clock_s
    if before is None:
        return unexamined("no simulator of MuJoCo is found, whose clock could be read")
    for _ in range(_STEPS):
        subject.step(NOOP_ACTION)
    after = subject.clock_s
    assert after is not None
    step_s, meant_s = (after - before) / _STEPS, 1.0 / subject.reference.control_hz
    if abs(step_s - meant_s) < 1e-6:
        return kept(f"a step takes {1000 * step_s:.0f} ms of simulated time")
    return broken(
        f"a step takes {1000 * step_s:.1f} ms of simulated time",
        f"{1000 * meant_s:.0f} ms",
        f"LIBERO is controlled at {subject.reference.control_hz} Hz: policies and budgets rely on it.",
    )


@rule("env/clock/budget", "must", needs=KEYS)
def budget(subject: EnvironmentSubject) -> Finding:
    """Let an episode in which nothing is solved last as long as its budget."""
    steps = subject.reference.budget
    subject.begin()
    for number in range(1, steps + 1):
        try:
            played = subject.step(NOOP_ACTION)
        except SubstrateError as error:
            ending = str(error)
        else:
            ending = "the episode ended" if played.done and number < steps else ""
        if ending:
            subject.abandon()
            return broken(
                f"after {number} of {steps} no-op steps: {ending}",
                f"an episode of {steps} steps",
                "Settle steps do not count, and nothing else ends an episode than its goal.",
            )
    return kept(f"{steps} no-op steps are played")


@rule("env/clock/limit", "note", needs=KEYS)
def limit(subject: EnvironmentSubject) -> Finding:
    """End an episode at the budget of its suite."""
    spec = subject.attribute("spec")
    steps = getattr(spec, "max_episode_steps", None)
    steps = (
        subject.attribute("_max_episode_steps", "max_episode_steps", "max_steps") if steps is None else steps
    )
    budget = subject.reference.budget
    if not isinstance(steps, int):
        return unexamined("it has no limit of its own; who drives it counts")
    return judged(
        steps == budget,
        f"{steps} steps",
        f"{counted(budget, 'step')}, as the benchmark's protocol has it",
        "A longer episode solves more: say the limit beside each number.",
    )
