"""Base of a scripted policy, played or replayed, compared between versions of MuJoCo, robosuite and the loop.

``python -m tests.scripts.versions play here.npz --assets FOLDER`` plays Base alone on an installed LIBERO,
with ``--substrate embedded`` on embedded scenes. It prints a line a task (solved, mean and most steps), and
keeps actions and joint positions of every episode and a picture of every task. ``--replay there.npz`` plays
the actions that are kept there, whatever the policy would do. ``--loop package`` leaves each control step to
the package's own environment instead of ours. Interrupted, the same command goes on where it stopped, task
by task; a file of another version or policy is refused. ``python -m tests.scripts.versions compare here.npz
there.npz...`` says in what each other file differs from the first: in all, and by scene; with ``--steps``
where each scene parts and how far it goes. ``python -m tests.scripts.versions bisect FOLDER --package mujoco
--releases 3.4.0 3.5.0 ...`` makes an environment for each release that it needs, beside this one and with
everything else of it, and names the release that moved each scene; the same command goes on.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.lab.bisection import first_bad
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.substrates.libero.initial_states import read_states
from pytest_libero_max.substrates.libero.installation import find_installation
from pytest_libero_max.substrates.libero.package_env import Built, build
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.libero.tasks import Task, task_of
from pytest_libero_max.substrates.libero.world import LiberoWorld
from pytest_libero_max.worlds.mujoco_world import MujocoWorld
from pytest_libero_max.worlds.robot import CAMERAS
from tests.scripts.measure import blind, make_case

import mujoco  # isort: skip - the rooms above have settled its backend

Array = NDArray[Any]

EXPERT = "expert"
MADE = "made"
"""Name of the versions and of the policy of a file."""
FAR = (0.0, 1e-6, 1e-3)
"""Differences of a joint position, m or rad, whose first step is reported."""


class PackageWorld(LiberoWorld):
    """A genuine scene that shows what the package's own environment does, and does nothing itself.

    Args:
        task: The task.
        make: Builds its environment. A second reset of the same one would place some fixtures elsewhere.
    """

    def __init__(self, task: Task, make: Callable[[], Built]) -> None:
        self._make = make
        self._own = make()
        self._played = False
        scene = f"package/{task.suite}/{task.index}"
        super().__init__(scene, task.language, make(), read_states(task.states))

    def reset(self, init: int) -> None:
        super().reset(init)
        self._own.env.close()
        self._own, self._played = self._make(), False
        self._own.wrapper.set_init_state(self.initial_state(init))

    def succeeded(self) -> bool:
        return self._played

    def _control_step(self, action: Array) -> None:
        self._played = bool(self._own.wrapper.step(action)[2])
        own, kind = self._own.env.sim, mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.zeros(mujoco.mj_stateSize(self._model, kind))
        mujoco.mj_getState(own.model._model, own.data._data, state, kind)
        mujoco.mj_setState(self._model, self._data, state, kind)
        self._settle()


def package_world(substrate: LiberoSubstrate, case: Case) -> PackageWorld:
    """The world of a case's task on which the package plays."""
    installation = substrate.installation_for("libero")
    task = task_of(installation, case.suite, case.task_index)
    return PackageWorld(task, partial(build, installation, task.bddl, case.policy_seed))


def play(options: argparse.Namespace) -> Iterator[str]:
    """Play Base on every task and keep what happened; a line for each task, then the total."""
    policy, recorded = blind(str(options.policy)), np.load(options.replay) if options.replay else {}
    made = (
        f"MuJoCo {version('mujoco')}, robosuite {version('robosuite')}, NumPy {version('numpy')}, "
        f"{options.loop} loop, {options.policy}"
    )
    kept = begun(options.file, made)
    solved = played = 0
    for suite, index in ((suite, index) for suite in options.suites for index in options.tasks):
        names = [f"{suite}/{index}/{init}" for init in range(options.inits)]
        if all(f"{name}/success" in kept for name in names):
            solved += sum(bool(kept[f"{name}/success"]) for name in names)
            played += options.inits
            continue
        substrate = opened(options)
        lengths = []
        for init in range(options.inits):
            case = make_case(suite, index, init)
            if options.loop == "ours":
                world: MujocoWorld = substrate.world(case)
            elif init == 0:
                assert isinstance(substrate, LiberoSubstrate)
                world = package_world(substrate, case)
            name = f"{suite}/{index}/{init}"
            episode = trajectory(case, world, policy, recorded[f"{name}/actions"] if options.replay else None)
            kept |= {f"{name}/{part}": value for part, value in episode._asdict().items()}
            lengths += [len(episode.path)] if episode.success else []
        if options.loop == "ours":
            world.reset(0)
            for camera, picture in world.observe(CAMERAS, 256).items():
                if camera.endswith("_image"):
                    kept[f"{suite}/{index}/{camera}"] = picture
        world.close()
        solved, played = solved + len(lengths), played + options.inits
        part = options.file.with_suffix(".part.npz")
        np.savez_compressed(part, **kept)
        part.replace(options.file)
        mean = f"{np.mean(lengths):.0f}" if lengths else "-"
        yield f"| {suite} | {index} | {len(lengths)}/{options.inits} | {mean} | {max(lengths, default='-')} |"
    yield f"| all | | {solved}/{played} | | |"
    yield made


def begun(path: Path, made: str) -> dict[str, Any]:
    """Return what a file holds already of the same versions and policy.

    Raises:
        SystemExit: It is of others.
    """
    if not path.exists():
        return {MADE: np.array(made)}
    kept = dict(np.load(path))
    if str(kept.get(MADE)) != made:
        sys.exit(f"{path} is of {kept.get(MADE)}, and this is {made}. Remove it, or give another file.")
    return kept


def opened(options: argparse.Namespace) -> EmbeddedSubstrate | LiberoSubstrate:
    if options.substrate == "embedded":
        return EmbeddedSubstrate()
    return LiberoSubstrate([find_installation(options.root, assets=options.assets)])


class Episode(NamedTuple):
    """What is kept of an episode.

    Attributes:
        path: (steps, nq) joint positions after each policy step, m or rad.
        actions: (steps, 7) as they were executed.
        success: True if the task was solved.
    """

    path: Array
    actions: Array
    success: bool


def trajectory(case: Case, world: MujocoWorld, policy: Any, actions: Array | None = None) -> Episode:
    """Play an episode, or execute actions until they end or the task is solved."""
    rollout, path = Rollout.start(Stage(case, world, policy)), []
    replayed = iter(actions) if actions is not None else None
    while rollout.running:
        if replayed is None:
            rollout.advance()
        elif (action := next(replayed, None)) is not None:
            rollout.let_happen()
            rollout.execute(action)
        else:
            break
        path.append(world.data.qpos.copy())
    return Episode(np.array(path), rollout.trajectory.actions, rollout.success)


HEAD = (
    "| file | solved | outcomes that differ | lengths that differ | off by more than 0 | 1e-6 | 1e-3 "
    "| pictures that differ |\n|---|---|---|---|---|---|---|---|"
)
"""A column for each of ``FAR``: episodes, and the median of the first step."""


def compare(files: Mapping[str, Mapping[str, Array]]) -> Iterator[str]:
    """A table of what differs from the first file, over the episodes and pictures that both have."""
    (name, first), *others = files.items()
    everything = [one.removesuffix("/path") for one in first if one.endswith("/path")]
    yield HEAD
    yield f"| {name} | {solved_of(first, everything)} | | | | | | |"
    for other_name, other in others:
        episodes = [one for one in everything if f"{one}/path" in other]
        cells = [
            solved_of(other, episodes),
            str(len(flipped(first, other, episodes))),
            lengths(first, other, episodes),
            *(far(first, other, episodes, bound) for bound in FAR),
            pictures(first, other),
        ]
        yield f"| {other_name} | {' | '.join(cells)} |"
    yield from by_scene(first, dict(others), everything)


def solved_of(file: Mapping[str, Array], episodes: Sequence[str]) -> str:
    """How many of some episodes are solved."""
    return f"{sum(bool(file[f'{one}/success']) for one in episodes)}/{len(episodes)}"


def by_scene(
    first: Mapping[str, Array], others: Mapping[str, Mapping[str, Array]], episodes: Iterable[str]
) -> Iterator[str]:
    """A line for each scene with an outcome that differs: in which files, from which initial states."""
    scenes: dict[str, list[str]] = {}
    for name, other in others.items():
        for one in flipped(first, other, [one for one in episodes if f"{one}/path" in other]):
            scene, _, init = one.rpartition("/")
            scenes.setdefault(scene, []).append(f"{name} from state {init}")
    for scene, where in sorted(scenes.items()):
        yield f"{scene}: {', '.join(where)}"


def flipped(first: Mapping[str, Array], other: Mapping[str, Array], episodes: Iterable[str]) -> list[str]:
    """The episodes that only one of the two solved."""
    return [one for one in episodes if bool(first[f"{one}/success"]) != bool(other[f"{one}/success"])]


def divergences(
    first: Mapping[str, Array], others: Mapping[str, Mapping[str, Array]], bound: float
) -> Iterator[str]:
    """A table: for each scene and file, the first step beyond a bound, and the largest difference of all."""
    yield f"| Scene | {' | '.join(others)} |"
    yield f"|---|{'---|' * len(others)}"
    scenes: dict[str, list[str]] = {}
    for name in first:
        if name.endswith("/path"):
            episode = name.removesuffix("/path")
            scenes.setdefault(episode.rpartition("/")[0], []).append(episode)
    for scene, episodes in scenes.items():
        cells = [parting(first, other, episodes, bound) or "equal" for other in others.values()]
        yield f"| {scene} | {' | '.join(cells)} |"


def parting(
    first: Mapping[str, Array], other: Mapping[str, Array], episodes: Iterable[str], bound: float
) -> str:
    """The first step beyond a bound and the largest difference, of some episodes; empty where none is."""
    pairs = [(first[f"{one}/path"], other[f"{one}/path"]) for one in episodes if f"{one}/path" in other]
    steps = [step for pair in pairs if (step := first_beyond(*pair, bound)) is not None]
    size = max((np.abs(one[: len(two)] - two[: len(one)]).max(initial=0.0) for one, two in pairs), default=0)
    return f"{min(steps)}, {size:.1g}" if steps else ""


def bisect(options: argparse.Namespace) -> Iterator[str]:
    """A line for each scene: the release that moved it, the first step, and the largest difference."""
    options.folder.mkdir(parents=True, exist_ok=True)
    for suite, task in ((suite, task) for suite in options.suites for task in options.tasks):
        yield f"| {suite}/{task} | {moved_by(options, suite, task)} |"


def moved_by(options: argparse.Namespace, suite: str, task: int) -> str:
    """The release that moved a scene, and how; all are compared with the first one."""
    reference = options.folder / f"{options.releases[0]}.npz"
    run_release(options, options.releases[0], reference, suite, task)
    episodes = [f"{suite}/{task}/{init}" for init in range(options.inits)]
    parted: dict[int, str] = {}

    def moved(number: int) -> bool:
        release = options.releases[number]
        file = options.folder / f"{release}-replayed.npz"
        run_release(options, release, file, suite, task, "--replay", str(reference))
        parted[number] = parting(np.load(reference), np.load(file), episodes, options.bound)
        return bool(parted[number])

    if not moved(len(options.releases) - 1):
        return "none"
    _, number = first_bad(len(options.releases), lambda number: "bad" if moved(number) else "good")
    return f"{options.releases[number]} | {parted[number]}"


def run_release(
    options: argparse.Namespace, release: str, file: Path, suite: str, task: int, *more: str
) -> None:
    """Play one scene with a release, in an environment that has everything else of this one.

    Raises:
        CalledProcessError: The release cannot be installed, or the scene not be played.
    """
    done = np.load(file) if file.exists() else {}
    if all(f"{suite}/{task}/{init}/success" in done for init in range(options.inits)):
        return
    python = options.folder / f"{options.package}-{release}" / "bin" / "python"
    if not python.with_name("made").exists():
        subprocess.run([sys.executable, "-m", "venv", python.parents[1]], check=True)
        wanted = f"{options.package}=={release}"
        subprocess.run([python, "-m", "pip", "install", "--quiet", "--no-deps", wanted], check=True)
        (found,) = python.parents[1].glob("lib/python*/site-packages")
        (found / "beside.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
        python.with_name("made").touch()
    scene = ("--suites", suite, "--tasks", str(task), "--inits", str(options.inits))
    command = [python, "-m", "tests.scripts.versions", "play", file, "--substrate", "embedded", *scene, *more]
    subprocess.run([*command, "--policy", options.policy], check=True, stdout=subprocess.DEVNULL)


def lengths(first: Mapping[str, Array], other: Mapping[str, Array], episodes: Iterable[str]) -> str:
    """How many episodes have another length, and by how much at most."""
    changed = [abs(len(first[f"{one}/path"]) - len(other[f"{one}/path"])) for one in episodes]
    count = sum(length > 0 for length in changed)
    return f"{count}, by at most {max(changed)}" if count else "0"


def far(first: Mapping[str, Array], other: Mapping[str, Array], episodes: Iterable[str], bound: float) -> str:
    """How many episodes are further apart than a bound, and the median of the first step that is."""
    found = [first_beyond(first[f"{one}/path"], other[f"{one}/path"], bound) for one in episodes]
    steps = [step for step in found if step is not None]
    return f"{len(steps)}, {np.median(steps):.0f}" if steps else "0"


def pictures(first: Mapping[str, Array], other: Mapping[str, Array]) -> str:
    """How many pictures differ, in how many of their pixels on average, and by how much at most."""
    names = [name for name in first if name.endswith("_image") and name in other]
    off = [np.abs(first[name].astype(int) - other[name]) for name in names]
    share = [float((one > 0).any(axis=2).mean()) for one in off]
    count = sum(one > 0 for one in share)
    if not count:
        return f"0/{len(names)}"
    most = max(int(one.max()) for one in off)
    return f"{count}/{len(names)}, {100 * np.mean(share):.2f}% of pixels, by at most {most}"


def first_beyond(one: Array, other: Array, bound: float) -> int | None:
    """The first step (1 is the first) after which two paths are further apart than ``bound``."""
    steps = min(len(one), len(other))
    beyond = (np.abs(one[:steps] - other[:steps]) > bound).any(axis=1)
    return int(np.argmax(beyond)) + 1 if beyond.any() else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    commands = parser.add_subparsers(required=True, dest="command")
    player = commands.add_parser("play", help="play Base and keep the trajectories")
    player.add_argument("file", type=Path, help="where to keep them, .npz")
    player.add_argument("--policy", default=EXPERT, help="its name or file (default: %(default)s)")
    player.add_argument("--substrate", choices=("embedded", "libero"), default="libero")
    player.add_argument("--replay", type=Path, help="execute the actions that this file keeps")
    player.add_argument("--root", type=Path, help="folder of the installation (default: what is importable)")
    player.add_argument("--assets", type=Path, help="its assets, where it has none of its own")
    player.add_argument("--suites", nargs="+", default=["libero_spatial", "libero_object"])
    player.add_argument("--tasks", nargs="+", type=int, default=range(10), help="default: all ten")
    player.add_argument("--inits", type=int, default=10, help="initial states of each task (default 10)")
    player.add_argument("--loop", choices=("ours", "package"), default="ours", help="whose control step")
    comparer = commands.add_parser("compare", help="say in what files differ from the first")
    comparer.add_argument("files", nargs="+", type=Path)
    comparer.add_argument("--steps", type=float, metavar="BOUND", help="say where each scene parts by this")
    bisecter = commands.add_parser("bisect", help="name the release that moved each embedded scene")
    bisecter.add_argument("folder", type=Path, help="for environments and trajectories")
    bisecter.add_argument("--package", default="mujoco", choices=("mujoco", "robosuite", "numpy"))
    bisecter.add_argument("--releases", nargs="+", required=True, help="in their order, the first to compare")
    bisecter.add_argument("--bound", type=float, default=0.0, help="m or rad (default: %(default)s)")
    bisecter.add_argument("--policy", default=EXPERT, help="as for play")
    bisecter.add_argument("--suites", nargs="+", default=["libero_spatial"])
    bisecter.add_argument("--tasks", nargs="+", type=int, default=range(10))
    bisecter.add_argument("--inits", type=int, default=1)
    options = parser.parse_args()
    if options.command == "compare":
        files = {file.stem: np.load(file) for file in options.files}
        lines = compare(files)
        if options.steps is not None:
            (_, first), *others = files.items()
            lines = divergences(first, dict(others), options.steps)
    elif options.command == "bisect":
        lines = bisect(options)
    else:
        lines = play(options)
    for line in lines:
        print(line, flush=True)


if __name__ == "__main__":
    main()
