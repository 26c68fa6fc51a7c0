"""Writes a recorded pair as a recording of Rerun (``.rrd``): everything on one timeline, to be explored.

``rerun FILE.rrd`` shows it (https://rerun.io). The recorded actions are played again, and a replay that does
not reach the recorded digests leaves no file.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ReportError, install_extra
from pytest_libero_max.films.drawing import labels, shared_steps
from pytest_libero_max.films.recorded import Drawn
from pytest_libero_max.films.replay import Look, Tick, View, opening_m, play_again
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.trace import ArmTrace
from pytest_libero_max.runs.media import distinct_arms
from pytest_libero_max.worlds.contract import Image, OnMujoco, World
from pytest_libero_max.worlds.rendering.appearance import pose_of_camera
from pytest_libero_max.worlds.robot import CAMERAS

if TYPE_CHECKING:
    import rerun

INSTALL = install_extra("rerun")

ACTION = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z", "gripper")

_APPLICATION = "pytest-libero-max"
_JPEG_QUALITY = 85
_HAND, _TARGET, _OTHER = (20, 112, 138), (224, 161, 0), (135, 148, 161)

Pose = tuple[NDArray[np.float64], NDArray[np.float64]]
Camera = tuple[NDArray[np.float64], NDArray[np.float64], float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene(View):
    """View of a world, with the poses of everything in it."""

    hand: NDArray[np.float64]
    """(3,) m, world frame."""
    entities: Mapping[str, Pose]
    """(3,) m and (4,) w, x, y, z of each, world frame, by name."""
    cameras: Mapping[str, Camera]
    """(3,) m, the (3, 3) rotation of each from its own frame (x right, y up, looking along -z) to the
    world's, and its vertical angle of view in rad, by name."""


def scenes(size: int) -> Look:
    """Return a look that records where everything in a world is, with images of ``size`` pixels."""

    def look(name: str, step: int, world: World, before: View | None) -> View:
        assert isinstance(world, OnMujoco)
        observation = world.observe(CAMERAS, size)
        images = {camera: observation[f"{camera}_image"][::-1] for camera in CAMERAS}
        parked = set(world.parked)
        return Scene(
            images,
            opening_m(world, observation),
            hand=np.array(world.end_effector()),
            entities={entity: world.pose(entity) for entity in world.entities if entity not in parked},
            cameras={camera: pose_of_camera(world, camera) for camera in CAMERAS},
        )

    return look


def record_pair(
    path: Path,
    case: Case,
    world: World,
    record: PairRecord,
    traces: Mapping[str, ArmTrace],
    how: Drawn = Drawn(),  # noqa: B008 - it is frozen
) -> None:
    """Play a recorded pair again and write it for Rerun (``.rrd``), or nothing at all.

    Arguments and errors are those of :func:`.recorded.film_pair`; the extra ``rerun`` may be missing as well.
    """
    if importlib.util.find_spec("rerun") is None:
        raise ReportError(f"A recording of Rerun needs its library: {INSTALL}.")
    if path.exists() and not how.overwrite:
        raise ReportError(f"{path} exists. Remove it, or allow that it is overwritten.")
    import rerun

    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    strict = rerun.strict_mode()
    rerun.set_strict_mode(True)  # otherwise the library warns of what it cannot write, and leaves it out
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        stream = rerun.RecordingStream(_APPLICATION, recording_id=record.item_id)
        stream.save(str(partial), default_blueprint=_layout(record))
        ticks = play_again(case, world, record, traces, scenes(how.size), how.every)
        _Writer(stream, record, traces).write(how.tell(ticks))
        stream.flush()
        stream.disconnect()
        os.replace(partial, path)
    except (OSError, RuntimeError) as error:
        raise ReportError(f"Cannot write {path}: {error}.") from error
    finally:
        rerun.set_strict_mode(strict)
        with suppress(OSError):  # there is nothing to remove after one that was completed
            partial.unlink()


class _Writer:
    """Logs the moments of a pair."""

    def __init__(
        self, stream: rerun.RecordingStream, record: PairRecord, traces: Mapping[str, ArmTrace]
    ) -> None:
        self._stream, self._record, self._traces = stream, record, traces
        self._arms = distinct_arms(record)
        self._shared = shared_steps(record, self._arms)
        self._said: dict[str, set[str]] = {name: set() for name in self._arms}

    def write(self, ticks: Iterable[Tick]) -> None:
        import rerun

        record = self._record
        facts = {"case": record.item_id, "instruction": record.instruction, "outcome": record.outcome}
        facts |= {"event": f"{record.event} v{record.variant}", "policy": str(record.policy.get("name"))}
        lines = "".join(f"- **{name}**: {value}\n" for name, value in facts.items())
        self._stream.log("case", rerun.TextDocument(lines, media_type="text/markdown"), static=True)
        self._stream.disable_timeline("log_time")
        self._stream.disable_timeline("log_tick")
        for name in self._arms:
            self._stream.log(name, rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            way = self._traces[name].end_effector
            self._stream.log(f"{name}/way", rerun.LineStrips3D([way], colors=[_HAND]), static=True)
        done = -1
        for tick in ticks:
            for step in range(done + 1, tick.step + 1):  # also those without pictures
                self._set_time(step)
                for name in self._arms:
                    self._write_curves(name, step)
                    self._write_words(name, step)
            for name in self._arms:
                scene = tick.views[name]
                assert isinstance(scene, Scene)
                if tick.step <= record.arms[name].steps:
                    self._write_scene(name, scene)
            done = tick.step

    def _set_time(self, step: int) -> None:
        self._stream.set_time("step", sequence=step)
        self._stream.set_time("time", duration=step / self._record.control_hz)

    def _write_scene(self, name: str, scene: Scene) -> None:
        import rerun

        log = self._stream.log
        log(f"{name}/gripper_opening_m", rerun.Scalars([scene.opening_m]))
        log(f"{name}/hand", rerun.Points3D([scene.hand], colors=[_HAND], radii=[0.015]))
        for entity, (position, quaternion) in scene.entities.items():
            w, x, y, z = quaternion
            is_target = entity == self._record.trigger_entity
            place = rerun.Transform3D(translation=position, quaternion=rerun.Quaternion(xyzw=[x, y, z, w]))
            log(f"{name}/entities/{entity}", place)
            point = rerun.Points3D(
                [(0, 0, 0)],
                colors=[_TARGET if is_target else _OTHER],
                radii=[0.012],
                labels=[entity],
                show_labels=is_target,
            )
            log(f"{name}/entities/{entity}", point)
        for camera, (position, rotation, angle) in scene.cameras.items():
            height, width = scene.images[camera].shape[:2]
            where = f"{name}/cameras/{camera}"
            log(where, rerun.Transform3D(translation=position, mat3x3=rotation))
            lens = rerun.Pinhole(
                focal_length=float(0.5 * height / np.tan(0.5 * angle)),
                width=width,
                height=height,
                camera_xyz=rerun.ViewCoordinates.RUB,
                image_plane_distance=0.15,
            )
            log(where, lens)
            log(f"{where}/image", _compressed(scene.images[camera]))

    def _write_curves(self, name: str, step: int) -> None:
        import rerun

        trace = self._traces[name]
        if 0 < step <= len(trace.actions):
            for part, value in zip(ACTION, trace.actions[step - 1], strict=True):
                self._stream.log(f"{name}/action/{part}", rerun.Scalars([value]))
            distance = float(np.linalg.norm(trace.end_effector[step - 1] - trace.entity[step - 1]))
            self._stream.log(f"{name}/distance_m", rerun.Scalars([distance]))

    def _write_words(self, name: str, step: int) -> None:
        """Log each entry of an arm once."""
        import rerun

        queries = self._traces[name].query_steps.tolist()
        words = [f"query {queries.index(step)} at step {step}"] if step in queries else []
        words += [label.words for label in labels(self._record, name, step, self._shared)]
        for said in words:
            if said not in self._said[name]:
                self._said[name].add(said)
                self._stream.log(f"{name}/words", rerun.TextLog(said))


def _layout(record: PairRecord) -> Any:
    """Layout that the viewer opens with: an arm a column, curves and words below."""
    import rerun.blueprint as blueprint

    arms = distinct_arms(record)
    columns = [
        blueprint.Vertical(
            blueprint.Spatial3DView(origin=name, name=name),
            blueprint.Horizontal(
                *(
                    blueprint.Spatial2DView(origin=f"{name}/cameras/{camera}", name=camera)
                    for camera in CAMERAS
                )
            ),
        )
        for name in arms
    ]
    curves = {
        "distance to the trigger entity, m": [f"/{name}/distance_m" for name in arms],
        "gripper opening, m": [f"/{name}/gripper_opening_m" for name in arms],
        "actions": [f"/{name}/action/**" for name in arms],
    }
    below = [
        *(blueprint.TimeSeriesView(contents=paths, name=title) for title, paths in curves.items()),
        blueprint.TextLogView(contents=[f"/{name}/words" for name in arms], name="what happens"),
        blueprint.TextDocumentView(origin="case", name="case"),
    ]
    parts = blueprint.Vertical(
        blueprint.Horizontal(*columns), blueprint.Horizontal(*below), row_shares=[3, 1]
    )
    return blueprint.Blueprint(parts, blueprint.TimePanel(timeline="step"))


def _compressed(image: Image) -> Any:
    import rerun

    return rerun.Image(np.ascontiguousarray(image)).compress(jpeg_quality=_JPEG_QUALITY)
