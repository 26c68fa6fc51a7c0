"""Rules for time: the control rate, and how long an episode may be."""

from __future__ import annotations

from pytest_libero_max.conformance.environment.contract import KEYS
from pytest_libero_max.conformance.environment.subject import EnvironmentSubject
from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.errors import SubstrateError, counted
from pytest_libero_max.worlds.robot import NOOP_ACTION

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
