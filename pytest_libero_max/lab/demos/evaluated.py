"""Pairs of a run as episodes, in the format of demonstrations: what a policy did, with and without the event.

The recorded actions are played again, as for films, and the hash chain is computed again on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import OptionError
from pytest_libero_max.films.recorded import open_recorded
from pytest_libero_max.films.replay import View, opening_m, play_again
from pytest_libero_max.lab.demos.episodes import Demonstration, Planned
from pytest_libero_max.lab.demos.folder import EPISODES, Settings, begin_folder, save
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.trace import ArmTrace, trace_name
from pytest_libero_max.runs.media import TRACES_NAME, distinct_arms
from pytest_libero_max.worlds.contract import Observation, World
from pytest_libero_max.worlds.robot import CAMERAS


@dataclass(frozen=True, eq=False)
class _Seen(View):
    """A view with the whole observation of the world."""

    observation: Observation = field(default_factory=dict)
    """Images as LIBERO delivers them, and states."""


def collect_run(
    run_folder: Path,
    folder: Path,
    image_size: int,
    report: Callable[[int, int], None] = lambda done, total: None,
    *,
    cases: str | None = None,
    installations: Sequence[Path] = (),
    assets: Path | None = None,
) -> tuple[list[Path], int]:
    """Write each arm of the pairs of a run as an episode, whether the policy completed the task or not.

    An arm that equals an earlier one is left out.

    Args:
        folder: Folder of the episodes, made if missing; what it holds already is not made again.
        image_size: Side of the images, pixels.
        report: Called with the number of finished pairs and of all, after each pair.
        cases: As for :func:`~pytest_libero_max.films.recorded.open_recorded`, like those that follow.

    Returns:
        The files in the order of the pairs, and the number of pairs without traces.

    Raises:
        OptionError: The folder was begun with something else, or no pair has traces.
        ProtocolError: A pair comes out otherwise than it was recorded.
    """
    with open_recorded(run_folder, cases, installations, assets) as run:
        provenance = run.stored.run.provenance
        policy = str(provenance["policy"]["reference"])
        records = sorted(run.stored.records, key=lambda record: record.item_id)
        traced = [it for it in records if (run.folder / TRACES_NAME / trace_name(it.item_id)).exists()]
        if not traced:
            raise OptionError(f"{run.folder} has no pair with traces. Play it with --libero-max-traces=all.")
        begin_folder(folder, Settings(policy, image_size, provenance["substrate"]["name"]))
        paths: list[Path] = []
        for done, record in enumerate(traced, start=1):
            files = {arm: folder / EPISODES / f"{record.item_id}-{arm}.npz" for arm in distinct_arms(record)}
            if not all(path.exists() for path in files.values()):

                def write(case: Case, world: World, traces: Mapping[str, ArmTrace]) -> None:
                    for arm, demo in _arms(case, world, record, traces, image_size).items():  # noqa: B023
                        save(files[arm], Planned(case, arm), demo, record.item_id)  # noqa: B023  # used at once

                run.again(record, write)
            paths += files.values()
            report(done, len(traced))
    return paths, len(records) - len(traced)


def _arms(
    case: Case, world: World, record: PairRecord, traces: Mapping[str, ArmTrace], image_size: int
) -> dict[str, Demonstration]:
    def look(name: str, step: int, world: World, before: View | None) -> View:
        observation = world.observe(CAMERAS, image_size)
        return _Seen({}, opening_m(world, observation), observation=observation)

    shown: dict[str, list[Observation]] = {name: [] for name in distinct_arms(record)}
    for tick in play_again(case, world, record, traces, look):
        for name, view in tick.views.items():
            if tick.step < len(traces[name].actions):  # what is seen after the last action asks for none
                assert isinstance(view, _Seen)
                shown[name].append(view.observation)
    return {
        name: Demonstration(
            record.arms[name].success,
            record.instruction,
            record.arms[name].firings[0].step if record.arms[name].firings else None,
            {key: np.stack([frame[key] for frame in seen]) for key in sorted(seen[0])},
            traces[name].actions,
        )
        for name, seen in shown.items()
        if seen
    }
