"""Rules for what an answer depends on: each image, the state, the instruction."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from pytest_libero_max.conformance.policy.contract import ANSWERS
from pytest_libero_max.conformance.policy.determinism import not_repeatable
from pytest_libero_max.conformance.policy.subject import PolicySubject
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined

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
