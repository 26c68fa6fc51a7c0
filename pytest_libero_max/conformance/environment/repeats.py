"""Rules for determinism: the same bits again, in this process and in a new one."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from pytest_libero_max.conformance.environment.contract import SAME
from pytest_libero_max.conformance.environment.starts import INDEX
from pytest_libero_max.conformance.environment.subject import (
    EnvironmentSubject,
    Reading,
    copied,
    differing,
    open_environment,
)
from pytest_libero_max.conformance.fresh_process import result_elsewhere
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.errors import counted
from pytest_libero_max.worlds.robot import CAMERAS

_STEPS = 20
"""Steps of the recorded episode that are played again."""

_FRESH_S = 600.0
"""Longest time of the fresh process, s."""


@rule(SAME, "must", needs=INDEX)
def same_again(subject: EnvironmentSubject) -> Finding:
    """Arrive at the same observations from the same initial state with the same actions."""
    first, second = subject.once(_observations), _observations(subject)
    for step, (before, after) in enumerate(zip(first, second, strict=True)):
        parts = differing(before, after)
        if parts:
            return broken(
                f"the second time, the observation after {counted(step, 'step')} has another "
                f"{', '.join(parts)}",
                "the same observation",
                "Something outlives a reset: random numbers, a controller, fixtures that are placed anew.",
            )
    return kept(f"{counted(len(first) - 1, 'step')}, played twice, gave the same observations")


def _observations(subject: EnvironmentSubject) -> list[Reading]:
    readings = [copied(subject.begin(drawn=True))]
    for action in subject.reference.actions[:_STEPS]:
        readings.append(copied(subject.step(action).reading))
    return readings


def beginning(subject: EnvironmentSubject) -> dict[str, Any]:
    """Return what a process must find again: the state after each step, images as digests, fixtures."""
    steps = [
        {role: _plain(role, value) for role, value in reading.items()} for reading in _observations(subject)
    ]
    fixtures = subject.fixtures
    return {"steps": steps, "fixtures": None if fixtures is None else fixtures.tolist()}


def beginning_of(name: str) -> dict[str, Any]:
    """Return the beginning of the environment of a name."""
    return beginning(open_environment(name))


def _plain(role: str, value: Any) -> Any:
    if role in CAMERAS:
        return hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
    return value if isinstance(value, str) else value.tolist()


@rule("env/repeats/process", "must", needs=SAME)
def fresh_process(subject: EnvironmentSubject) -> Finding:
    """Arrive at the same observations, with every fixture in the same place, in another process."""
    if not subject.name:
        return unexamined("the environment is an object of this process")
    subject.abandon()
    here = json.loads(json.dumps(beginning(subject)))
    there = result_elsewhere(
        beginning_of,
        subject.name,
        _FRESH_S,
        expected="the same episode",
        cure="The environment needs something of this process or its home.",
        environment={"HOME": str(Path.home())},  # LIBERO keeps its paths there
    )
    return there if isinstance(there, Finding) else _compared(here, there)


def _compared(here: dict[str, Any], there: dict[str, Any]) -> Finding:
    parts = []
    if here["fixtures"] != there["fixtures"]:
        apart_m = np.abs(np.subtract(here["fixtures"], there["fixtures"])).max()
        parts.append(f"a fixture stands {1000 * apart_m:.1f} mm elsewhere")
    for step, (first, second) in enumerate(zip(here["steps"], there["steps"], strict=True)):
        differ = [role for role in first if first[role] != second.get(role)]
        if differ:
            parts.append(f"after {counted(step, 'step')} {', '.join(differ)} differ")
            break
    if not parts:
        return kept("another process has the same observations after each step")
    return broken(
        f"in another process {' and '.join(parts)}",
        "the same episode, bit for bit",
        "Seed numpy's global generator before each reset; let no hash or clock decide what is built.",
    )
