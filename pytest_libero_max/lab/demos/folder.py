"""A folder of demonstrations: one file for each episode, written once, so that interrupted work goes on."""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from pytest_libero_max.benchmark.array_files import read_arrays
from pytest_libero_max.errors import OptionError
from pytest_libero_max.lab.demos.episodes import Demonstration, Planned, record
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.worlds.threads import use_one_blas_thread

EPISODES = "episodes"
SETTINGS = "demos.json"
_NOT_SHOWN = ("about", "actions", "executed")


@dataclass(frozen=True)
class Settings:
    """Properties that all episodes of a folder share."""

    expert: str = "expert"
    image_size: int = 128
    substrate: str = "embedded"
    disturbed: float = 0.0
    """Share of the queries after which the hand is pushed aside."""


@dataclass(frozen=True)
class Found:
    """State of an episode in a folder."""

    name: str
    path: Path | None
    """Its file; None where the task was not completed, of which only a note is kept."""


def collect(
    plans: Sequence[Planned],
    folder: Path,
    settings: Settings,
    jobs: int = 1,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> list[Found]:
    """Record the episodes that a folder does not hold yet.

    Args:
        folder: Made if missing.
        report: Called with the number of finished episodes and of all, after each task.

    Returns:
        The state of each episode, in the order of the plans.

    Raises:
        OptionError: The folder was begun with other settings.
        SubstrateError: There is no such initial state.
        AdapterError: The expert cannot be loaded, or broke its contract.
    """
    begin_folder(folder, settings)
    todo = [plan for plan in plans if find(plan, folder) is None]
    batches = [
        list(group) for _, group in groupby(todo, lambda plan: (plan.case.suite, plan.case.task_index))
    ]
    done = len(plans) - len(todo)
    report(done, len(plans))
    if jobs == 1:
        sizes = (_record_all(batch, folder, settings) for batch in batches)
        for size in sizes:
            done += size
            report(done, len(plans))
    elif batches:
        use_one_blas_thread()
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(jobs, context) as pool:
            work = [pool.submit(_record_all, batch, folder, settings) for batch in batches]
            try:
                for future in work:
                    done += future.result()
                    report(done, len(plans))
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
    return [path for plan in plans if (path := find(plan, folder)) is not None]


def find(plan: Planned, folder: Path) -> Found | None:
    """Return a folder's state of an episode; None where it has not been played."""
    path = folder / EPISODES / f"{plan.name}.npz"
    if path.exists():
        return Found(plan.name, path)
    return Found(plan.name, None) if path.with_suffix(".unsolved").exists() else None


def load(path: Path) -> tuple[Demonstration, dict[str, Any]]:
    """Return the episode of a file, and its source, suite, task, initial state, arm and event."""
    arrays = read_arrays(path)
    about = json.loads(str(arrays["about"]))
    observations = {key: value for key, value in arrays.items() if key not in _NOT_SHOWN}
    actions, executed = arrays["actions"], arrays.get("executed")
    return (
        Demonstration(
            about["success"],
            about["instruction"],
            about["event_step"],
            observations,
            actions,
            executed,
        ),
        about,
    )


def begin_folder(folder: Path, settings: Settings) -> None:
    """Make a folder for episodes, or refuse one that was begun with other settings."""
    path = folder / SETTINGS
    begun = {"format": 1, **asdict(settings)}
    if path.exists():
        try:
            there = json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise OptionError(f"{path} is no JSON document ({error}). Name another folder.") from error
        if there != begun:
            raise OptionError(
                f"{folder} was begun with {there}, but this is {begun}. Name another folder, or remove "
                "this one."
            )
        return
    (folder / EPISODES).mkdir(parents=True, exist_ok=True)
    _write(path, lambda partial: partial.write_text(json.dumps(begun, indent=2) + "\n", encoding="utf-8"))


def _record_all(plans: Sequence[Planned], folder: Path, settings: Settings) -> int:
    """Record episodes of one task; return their number."""
    policy, substrate = load_policy(settings.expert), open_substrate(settings.substrate)
    try:
        for plan in plans:
            demo = record(plan, substrate.world(plan.case), policy, settings.image_size, settings.disturbed)
            path = folder / EPISODES / f"{plan.name}.npz"
            if demo.success:
                save(path, plan, demo)
            else:
                _write(path.with_suffix(".unsolved"), lambda partial: partial.touch())
    finally:
        substrate.close()
    return len(plans)


def save(path: Path, plan: Planned, demo: Demonstration, pair: str | None = None) -> None:
    """Write an episode, for :func:`load`; ``pair`` is the item id of the measured pair that it belongs to."""
    event = plan.case.event
    about = {
        "source": plan.case.source,
        "suite": plan.case.suite,
        "task_index": plan.case.task_index,
        "init_state_index": plan.case.init_state_index,
        "instruction": demo.instruction,
        "arm": plan.arm,
        "event": event.name if demo.event_step is not None else None,
        "variant": event.variant if demo.event_step is not None else None,
        "event_step": demo.event_step,
        "success": demo.success,
        "pair": pair,
    }
    arrays = {**demo.observations, "actions": demo.actions, "about": np.array(json.dumps(about))}
    if demo.executed is not None:
        arrays["executed"] = demo.executed

    def write(partial: Path) -> None:
        with partial.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # its stubs know no keywords

    _write(path, write)


def _write(path: Path, write: Callable[[Path], Any]) -> None:
    """Write a file that is there whole or not at all."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    write(partial)
    os.replace(partial, path)
