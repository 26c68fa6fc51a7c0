"""Fingerprint of an installation: what it computes and draws on a few cases, layer by layer.

Each layer has a digest, which says whether two installations agree, and numbers, which say by how much they
do not.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.documents import Json, canonical_digest, read_content
from pytest_libero_max.errors import OptionError, counted
from pytest_libero_max.worlds.contract import (
    AlterableWorld,
    Observation,
    OnMujoco,
    World,
    alterable,
    on_mujoco,
)
from pytest_libero_max.worlds.rendering.context import RENDERING
from pytest_libero_max.worlds.robot import CAMERAS

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.policies.contract import Episode, Query
    from pytest_libero_max.substrates.contract import Substrate

TRACK = "original"
"""Track of the cases: unmodified scenes, which every substrate has."""

FORMAT = 2
STEPS = 20
"""Steps of bare physics, and of the replay of fixed actions."""
SIZE_PX, BLOCKS = 128, 8
"""Side of an image, and number of its blocks along a side whose mean colours are kept."""
PROFILE_PX = 256
"""Side of the images that profiles prepare."""

LAYERS: Mapping[str, str] = {
    "scene": "fields",
    "textures": "fields",
    "physics": "rad or m",
    "control": "N m or N",
    "replay": "m",
    "drawing": "grey levels",
    "events": "",
    "event_pictures": "grey levels",
    "inputs": "",
    "queries": "steps",
}
"""Unit of the numbers by layer, from the first cause to the last effect; the last two depend on no other."""


def take(substrate: Substrate) -> Json:
    """Return the fingerprint of an installation: of one case for each event, in turn of each suite.

    Beside these, ``inputs`` holds what every profile makes of one made-up observation, and ``queries`` when a
    policy is asked in a pair.

    Raises:
        SubstrateError: A scene cannot be built.
    """
    cases: Json = {}
    for case in _cases():
        cases[case.item_id] = _layers(case, alterable(substrate.world(case)))
    first = next(_cases())
    parts = {"inputs": _inputs(), "queries": {first.item_id: _queries(first, substrate.world(first))}}
    found = {name: parts.get(name) or {key: case[name] for key, case in cases.items()} for name in LAYERS}
    layers = {
        name: canonical_digest([one["digest"] for one in entries.values()]) for name, entries in found.items()
    }
    return {
        "format": FORMAT,
        "hash": canonical_digest(layers)[:12],
        "substrate": substrate.name,
        "layers": {name: digest[:12] for name, digest in layers.items()},
        "versions": {"python": platform.python_version(), **substrate.fingerprint(images=True)},
        "machine": platform.machine(),
        "cases": cases,
        **parts,
    }


def _cases() -> Iterator[Case]:
    """Yield the first case of each event of the track, of another suite each time."""
    from pytest_libero_max.benchmark.tracks import load_track
    from pytest_libero_max.tasks.suites import LIBERO_SUITES

    cases, suites = load_track(TRACK).cases, LIBERO_SUITES
    events = sorted({case.event.name for case in cases})
    for number, event in enumerate(events):
        suite = suites[number % len(suites)]
        yield next(
            (case for case in cases if (case.event.name, case.suite) == (event, suite)),
            next(case for case in cases if case.event.name == event),
        )


def _layers(case: Case, world: AlterableWorld) -> Json:
    """Return digest and numbers of each layer of one case; every layer begins at the reset."""
    from pytest_libero_max.changes.registry import change_from_dict
    from pytest_libero_max.events.schedules import change_of

    fields = {name: digest[:12] for name, digest in world.scene_fields().items()}
    textures = {name: fields.pop(name) for name in sorted(fields) if name.startswith("model.tex")}
    world.reset(case.init_state_index)
    pictures = _pictures(world)
    physics = _bare_physics(on_mujoco(world))
    path, torques = _replay(on_mujoco(world))
    world.reset(case.init_state_index)
    for raw in case.event.setup:
        change_from_dict(raw).apply(world)
    evidence = change_of(case).apply(world).to_dict()
    return {
        "scene": {"digest": canonical_digest(fields), "fields": fields},
        "textures": {"digest": canonical_digest(textures), "fields": textures},
        "physics": _numbers(physics),
        "control": _numbers(torques),
        "replay": _numbers(path),
        "drawing": pictures,
        "events": _numbers(list(_leaves(evidence)), canonical_digest(evidence)),
        "event_pictures": _pictures(world),
    }


def _bare_physics(world: OnMujoco) -> NDArray[np.float64]:
    import mujoco

    data = mujoco.MjData(world.model)
    data.qpos[:] = world.data.qpos
    mujoco.mj_forward(world.model, data)
    for _ in range(STEPS):
        mujoco.mj_step(world.model, data)
    return np.array(data.qpos)


def _replay(world: OnMujoco) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the path of the hand (steps, 3) under fixed actions, and the control after the first."""
    path, control = [], np.array(world.data.ctrl)
    for step, action in enumerate(_actions()):
        world.step(action)
        path.append(world.end_effector())
        if step == 0:
            control = np.array(world.data.ctrl)
    return np.array(path), control


def _actions() -> Iterator[NDArray[np.float64]]:
    """Yield the same actions in every process on every machine."""
    for step in range(STEPS):
        draws = hashlib.sha256(f"libero-max-fingerprint|{step}".encode()).digest()[:6]
        yield np.array([*(byte / 127.5 - 1.0 for byte in draws), 1.0 if step >= STEPS // 2 else -1.0])


def _pictures(world: World) -> Json:
    """Digest of the images of both cameras, and the mean colours of their blocks."""
    shown = world.observe(CAMERAS, SIZE_PX)
    images = np.stack([shown[f"{camera}_image"] for camera in CAMERAS])
    side = SIZE_PX // BLOCKS
    blocks = images.reshape(len(CAMERAS), BLOCKS, side, BLOCKS, side, 3).mean(axis=(2, 4))
    return _numbers(np.round(blocks, 3), hashlib.sha256(images.tobytes()).hexdigest())


def _inputs() -> Json:
    """Return digest and numbers of what each profile that ships makes of the same observation, by profile.

    The observation is made up, so that nothing of the scenes or of the renderer is in it.
    """
    from pytest_libero_max.policies.clients.messages import Request
    from pytest_libero_max.policies.profile import load_profile, profile_names
    from pytest_libero_max.worlds.robot import PANDA

    draw = np.random.Generator(np.random.PCG64(195))
    rows, columns = np.mgrid[:PROFILE_PX, :PROFILE_PX] / PROFILE_PX
    observation: dict[str, NDArray[Any]] = {
        f"{camera}_image": (
            127 * (1 + np.sin(9 * (number + 1) * np.stack([rows, columns, rows * columns], axis=2)))
        ).astype(np.uint8)
        for number, camera in enumerate(CAMERAS)
    }
    for name, size in PANDA.state.items():
        values = draw.uniform(-1.0, 1.0, size)
        observation[name] = values / np.linalg.norm(values) if name.endswith("quat") else values
    found = {}
    for name in profile_names():
        profile = load_profile(name)
        if any(field.startswith(("inputs.", "instruction.", "request.")) for field in profile.unknown()):
            continue  # it is completed by its user
        request = Request(profile)
        arrays = request.arrays(observation)
        words = request.instruction("put both moka pots on the stove")
        digest = hashlib.sha256(words.encode())
        for key, array in sorted(arrays.items()):
            digest.update(
                f"{key} {array.dtype} {array.shape}".encode() + np.ascontiguousarray(array).tobytes()
            )
        flat = [np.asarray(array, dtype=np.float64).ravel() for _, array in sorted(arrays.items())]
        kept = [part[:: max(1, len(part) // BLOCKS**2)] for part in flat]
        found[name] = _numbers(np.concatenate(kept or [np.zeros(0)]), digest.hexdigest())
    return found


def _queries(case: Case, world: World) -> Json:
    """Return when a policy is asked in Base and Dynamic, when the event happens, and what is stale then.

    The event happens at a fraction of the budget, wherever the hand is.
    """
    from pytest_libero_max.events.schedules import BASE, DYNAMIC, Arm, Entry, change_of
    from pytest_libero_max.events.triggers import BudgetFraction
    from pytest_libero_max.pairing.runner import measure_pair

    policy = _Asked()
    event = Entry(BudgetFraction(0.1), change_of(case))
    record = measure_pair(case, world, policy, arms=(Arm(BASE), Arm(DYNAMIC, (event,)))).record
    arm = record.arms[DYNAMIC]
    fired = [firing.step for firing in arm.firings]
    told = [-1 if value is None else value for value in (arm.response_step, arm.stale_actions, arm.steps)]
    return _numbers([*policy.steps, *map(float, fired), *map(float, told)])


class _Asked:
    """A policy that stands still, and notes when it is asked."""

    def __init__(self) -> None:
        from pytest_libero_max.policies.contract import PolicySpec

        self.spec = PolicySpec("fingerprint", horizon=8, query_interval=7, cameras=())
        self.steps: list[float] = []

    def reset(self, episode: Episode) -> None:
        """Know nothing of an episode."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        """Return eight actions without a movement."""
        self.steps.append(float(query.step))
        return np.zeros((8, 7))


def _numbers(values: NDArray[np.float64] | Sequence[float], digest: str | None = None) -> Json:
    numbers = np.asarray(values, dtype=np.float64)
    own = hashlib.sha256(numbers.tobytes()).hexdigest() if digest is None else digest
    return {"digest": own, "values": [float(f"{value:.12g}") for value in numbers.ravel()]}


def _leaves(value: Any) -> Iterator[float]:
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list | tuple):
        for item in value:
            yield from _leaves(item)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield float(value)


# Reading, printing and comparing.


def read_fingerprint(path: Path) -> Json:
    """Read a stored fingerprint.

    Raises:
        OptionError: It cannot be read, or is none of this format.
    """
    try:
        found = json.loads(read_content(path))
    except (OSError, ValueError) as error:
        raise OptionError(f"Cannot read the fingerprint {str(path)!r}: {error}.") from error
    if not isinstance(found, dict) or found.get("format") != FORMAT or "cases" not in found:
        raise OptionError(
            f"{path} is no fingerprint of format {FORMAT}. Write one: libero-max lab fingerprint "
            "--output FILE."
        )
    return found


def fingerprint_lines(found: Json) -> list[str]:
    """Return a fingerprint as lines: the hash to quote, its layers and versions."""
    versions = ", ".join(
        f"{name} {value}"
        for name, value in found["versions"].items()
        if name in RENDERING or len(value) < 40  # no digests
    )
    return [
        f"{found['substrate']} {found['hash']}",
        "  " + "  ".join(f"{name} {digest}" for name, digest in found["layers"].items()),
        f"  {counted(len(found['cases']), 'case')} of the track {TRACK}; {versions}; {found['machine']}",
    ]


def comparison_lines(first: Json, second: Json) -> list[str]:
    """Return which layers of two installations differ, in how many cases, and by how much.

    Raises:
        OptionError: They are of different substrates or cases, so that nothing can be compared.
    """
    if first["substrate"] != second["substrate"] or first["cases"].keys() != second["cases"].keys():
        raise OptionError(
            f"One fingerprint is of {first['substrate']!r}, {counted(len(first['cases']), 'case')}, the "
            "other of "
            f"{second['substrate']!r}, {counted(len(second['cases']), 'case')}. Take both of the same "
            "substrate."
        )
    equal = "equals" if first["hash"] == second["hash"] else "differs from"
    lines = [f"{first['hash']} {equal} {second['hash']}"]
    for layer, unit in LAYERS.items():
        one, other = (
            found.get(layer) or {name: case[layer] for name, case in found["cases"].items()}
            for found in (first, second)
        )
        both = {name: (one[name], other[name]) for name in one if name in other}
        unequal = {name: pair for name, pair in both.items() if pair[0]["digest"] != pair[1]["digest"]}
        what = "profiles" if layer == "inputs" else "cases"
        parts = []
        if unequal:
            names = f" ({_first(sorted(unequal), 3, ', ...')})" if layer == "inputs" else ""
            parts.append(
                f"differs in {len(unequal)} of {len(both)} {what}{names}: {_gap(unequal.values(), unit)}"
            )
        if alone := one.keys() ^ other.keys():
            parts.append(f"{len(alone)} {what} are in one alone")
        lines.append(f"  {layer:<15} {'; '.join(parts) or 'equal'}")
    versions = [
        f"{name} {first['versions'].get(name, 'none')} / {second['versions'].get(name, 'none')}"
        for name in dict.fromkeys([*first["versions"], *second["versions"]])
        if first["versions"].get(name) != second["versions"].get(name)
    ]
    return [*lines, f"  versions        {'; '.join(versions) or 'equal'}"]


def _first(names: Sequence[str], count: int, rest: str) -> str:
    return ", ".join(names[:count]) + (rest if len(names) > count else "")


def _gap(unequal: Collection[tuple[Json, Json]], unit: str) -> str:
    if unit == "fields":
        both = [(one["fields"], other["fields"]) for one, other in unequal]
        names = sorted({name for a, b in both for name in a.keys() | b.keys() if a.get(name) != b.get(name)})
        return _first(names, 6, f" and {len(names) - 6} more")
    values = [(one["values"], other["values"]) for one, other in unequal]
    if any(len(one) != len(other) for one, other in values):
        return "they have other numbers of values"
    most = max((abs(a - b) for one, other in values for a, b in zip(one, other, strict=True)), default=0.0)
    if most == 0.0:
        return "less than what is kept shows"
    return f"largest difference {most:.3g} {unit}".rstrip()
