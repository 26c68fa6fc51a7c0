"""One report of what a machine draws and serves: its GPU beside its processor, to be sent to somebody.

Each section is measured by processes of their own, so that the device can be another one.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from pytest_libero_max.errors import SubstrateError, counted
from pytest_libero_max.machine import GIB, memory_bytes
from pytest_libero_max.makers.bench.images import (
    compare_images,
    device,
    measure_rates,
    rate_lines,
    same_lines,
)
from pytest_libero_max.makers.bench.serving import measure_serving, serving_lines
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.registry import DEFAULT, describe_substrate
from pytest_libero_max.worlds.rendering import egl, gl

GENUINE = "libero"


@dataclass(frozen=True)
class Plan:
    """Settings of a report."""

    options: SubstrateOptions
    """Location of a genuine LIBERO."""
    scenes: Sequence[tuple[str, int]]
    """Suites and numbers of tasks."""
    processes: Sequence[int]
    """Numbers of processes that draw, or ask, at once."""
    seconds: float = 5.0
    policy: str | None = None
    """Policy to serve; None: one that answers at once."""
    size: int = 256
    """Side of an image in pixels."""


def devices() -> list[tuple[str, str | None]]:
    """Return the devices to compare, by name, each with its number for ``MUJOCO_EGL_DEVICE_ID``.

    The first is the one that draws here, which needs no number; the second the processor, where that is
    another one.
    """
    result: list[tuple[str, str | None]] = [(device(), None)]
    if gl.require() == "egl" and not egl.chosen()[0].software:
        result += [
            (f"egl, {device_listed}", str(device_listed.number))
            for device_listed in egl.listed()
            if device_listed.software
        ][:1]
    return result


def device_report(plan: Plan, say: Callable[[str], None]) -> Iterator[str]:
    """Yield the lines of the report, in Markdown, as they are measured."""
    yield from ["# What this machine draws and serves", "", *_machine(), ""]
    substrates = [DEFAULT]
    try:
        describe_substrate(GENUINE, plan.options)
        substrates.append(GENUINE)
    except SubstrateError as error:
        yield from [f"Genuine scenes were not measured: {error}", ""]
    for name, number in devices():
        with nullcontext() if number is None else egl.asked_for(number):
            for substrate in substrates:
                yield from [f"## {substrate} scenes, drawn by {name}", ""]
                say(f"images of {substrate} scenes, drawn by {name}")
                rates = measure_rates(
                    substrate, plan.options, plan.scenes, plan.processes, seconds=plan.seconds, size=plan.size
                )
                yield from [*rate_lines([*rates]), ""]
                say(f"equal images of {substrate} scenes, drawn by {name}")
                same = compare_images(substrate, plan.options, plan.scenes, size=plan.size)
                yield from [*same_lines([*same]), ""]
    what = plan.policy or "a policy that answers at once"
    yield from [f"## One server of {what}", ""]
    say(f"a server of {what}")
    yield from serving_lines([*measure_serving(plan.policy, plan.processes, seconds=plan.seconds)])


def _machine() -> Iterator[str]:
    """Yield lines about the machine: nothing that names it or its user."""
    yield f"- pytest-libero-max {version('pytest-libero-max')}, MuJoCo {version('mujoco')}"
    yield f"- Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    cores = counted(len(os.sched_getaffinity(0)), "core")
    yield f"- {_processor()}, {cores}, {memory_bytes() / GIB:.0f} GiB memory"
    yield f"- load before: {os.getloadavg()[0]:.1f} (it should be near 0)"
    yield from (f"- {listed}{', the processor' if listed.software else ''}" for listed in egl.listed())
    for name in (gl.VARIABLE, egl.VARIABLE, egl.VISIBLE, "LP_NUM_THREADS"):
        if name in os.environ:
            yield f"- {name}={os.environ[name]}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or "unknown processor")
