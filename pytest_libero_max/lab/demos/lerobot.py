"""Demonstrations as a dataset of LeRobot, format 3.0: Parquet files with the images in them as PNG.

The names are those of LeRobot's own LIBERO: ``observation.images.image`` and ``image2`` turned by 180
degrees, ``observation.state`` of eight numbers (position, axis times angle, both fingers) and ``action``. A
column ``event`` says whether the event has happened, and the table of episodes which one it is
(``event_name``), from which step on (``event_step``), and whether the task was completed (``success``). The
format was read in LeRobot 0.6.1 (``lerobot/datasets``).
"""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import OptionError, install_extra
from pytest_libero_max.lab.demos.episodes import Demonstration
from pytest_libero_max.lab.demos.folder import load
from pytest_libero_max.policies.transforms.images import rotate_180
from pytest_libero_max.policies.transforms.states import axis_angle
from pytest_libero_max.worlds.robot import CAMERAS, CONTROL_HZ

VERSION = "v3.0"
CHUNK = "chunk-{0:03d}/file-{1:03d}.parquet"
FILE_BYTES = 100 * 2**20
"""Size of a file before the next one is begun, about; LeRobot's own default."""

IMAGES = dict(zip(CAMERAS, ("observation.images.image", "observation.images.image2"), strict=True))
STATE = ("x", "y", "z", "axis_angle1", "axis_angle2", "axis_angle3", "finger1", "finger2")
ACTION = ("x", "y", "z", "axis_angle1", "axis_angle2", "axis_angle3", "gripper")
NUMBERS = {
    "event": "bool",
    "timestamp": "float32",
    **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64"),
}


def require_pyarrow() -> None:
    """Refuse early where PyArrow is missing."""
    try:
        import pyarrow.parquet  # noqa: F401  # to be told
    except ImportError as error:
        raise OptionError(
            f"A dataset of LeRobot needs PyArrow: {install_extra('demos')}. The .npz files do not."
        ) from error


@dataclass
class Statistics:
    """Minimum, maximum, mean and standard deviation of the columns of rows that come in parts."""

    count: int = 0
    low: Any = np.inf
    high: Any = -np.inf
    total: Any = 0.0
    squares: Any = 0.0
    frames: int = 0

    def add(self, rows: NDArray[Any], frames: int) -> None:
        """Note (n, d) values that belong to some frames."""
        values = rows.astype(np.float64)
        self.count += len(values)
        self.frames += frames
        self.low = np.minimum(self.low, values.min(axis=0))
        self.high = np.maximum(self.high, values.max(axis=0))
        self.total = self.total + values.sum(axis=0)
        self.squares = self.squares + (values**2).sum(axis=0)

    def to_dict(self, *, image: bool) -> dict[str, Any]:
        """As LeRobot writes them; those of images have the shape (3, 1, 1)."""
        mean = self.total / self.count
        std = np.sqrt(np.maximum(self.squares / self.count - mean**2, 0.0))
        values = {"min": self.low, "max": self.high, "mean": mean, "std": std}
        shaped = {
            name: np.asarray(value).reshape((-1, 1, 1) if image else -1) for name, value in values.items()
        }
        return {name: value.tolist() for name, value in shaped.items()} | {"count": [self.frames]}


def write_dataset(paths: Sequence[Path], folder: Path) -> None:
    """Write episodes in their order as one dataset, which replaces an older one once it is complete.

    Raises:
        OptionError: PyArrow is missing, no episode can be read, or the folder holds something else.
    """
    require_pyarrow()
    if not paths:
        raise OptionError("There is no episode to write.")
    if folder.exists() and not (folder / "meta" / "info.json").exists():
        raise OptionError(f"{folder} exists and holds no dataset of LeRobot. Name another folder.")
    partial = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    try:
        Writer(partial).write(paths)
        shutil.rmtree(folder, ignore_errors=True)
        partial.replace(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


class Writer:
    """Writes a dataset."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._tasks: dict[str, int] = {}
        self._episodes: list[dict[str, Any]] = []
        self._statistics: dict[str, Statistics] = {}
        self._frames = 0
        self._side = 0

    def write(self, paths: Sequence[Path]) -> None:
        import pyarrow.parquet as parquet

        number, size, writer = -1, FILE_BYTES, None
        try:
            for demo, about in _read(paths):
                table, size_of_episode = self._table(demo, about)
                if writer is None or size >= FILE_BYTES:
                    if writer is not None:
                        writer.close()
                    number, size = number + 1, 0
                    path = self._folder / "data" / CHUNK.format(0, number)
                    path.parent.mkdir(parents=True, exist_ok=True)
                    writer = parquet.ParquetWriter(path, table.schema, compression="snappy")
                writer.write_table(table)
                size += size_of_episode
                self._episodes[-1] |= {"data/chunk_index": 0, "data/file_index": number}
        finally:
            if writer is not None:
                writer.close()
        self._write_meta()

    def _table(self, demo: Demonstration, about: dict[str, Any]) -> tuple[Any, int]:
        """Return the rows of an episode, and about how many bytes they have."""
        import pyarrow as pa

        length, episode = len(demo.actions), len(self._episodes)
        task = self._tasks.setdefault(demo.instruction, len(self._tasks))
        event = np.arange(length) >= (length if demo.event_step is None else demo.event_step)
        vectors = {"observation.state": states(demo), "action": demo.actions.astype(np.float32)}
        numbers: dict[str, NDArray[Any]] = {
            "event": event,
            "timestamp": (np.arange(length) / CONTROL_HZ).astype(np.float32),
            "frame_index": np.arange(length),
            "episode_index": np.full(length, episode),
            "index": self._frames + np.arange(length),
            "task_index": np.full(length, task),
        }
        columns: dict[str, Any] = {}
        size = 0
        for camera, key in IMAGES.items():
            images = [rotate_180(image) for image in demo.observations[f"{camera}_image"]]
            self._side = len(images[0])
            files = [_png(image) for image in images]
            size += sum(map(len, files))
            kind = pa.struct({"bytes": pa.binary(), "path": pa.string()})
            columns[key] = pa.array([{"bytes": file, "path": None} for file in files], kind)
            self._note(key, np.stack(images).reshape(-1, 3) / 255.0, length)
        for key, values in vectors.items():
            flat = pa.array(values.ravel(), pa.float32())
            columns[key] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
            self._note(key, values, length)
        for key, values in numbers.items():
            columns[key] = pa.array(values)
            self._note(key, values[:, None], length)
        self._episodes.append(
            {
                "episode_index": episode,
                "tasks": [demo.instruction],
                "length": length,
                "dataset_from_index": self._frames,
                "dataset_to_index": self._frames + length,
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                "source": about.get("source", "libero"),
                "suite": about["suite"],
                "libero_task_index": about["task_index"],
                "init_state_index": about["init_state_index"],
                "pair": about.get("pair"),
                "arm": about["arm"],
                "success": demo.success,
                "event_name": about["event"],
                "event_variant": about["variant"],
                "event_step": demo.event_step,
            }
        )
        self._frames += length
        return pa.table(columns), size

    def _note(self, key: str, rows: NDArray[Any], frames: int) -> None:
        self._statistics.setdefault(key, Statistics()).add(rows, frames)

    def _write_meta(self) -> None:
        import pyarrow as pa
        import pyarrow.parquet as parquet

        meta = self._folder / "meta"
        episodes = meta / "episodes" / CHUNK.format(0, 0)
        episodes.parent.mkdir(parents=True)
        optional = {
            "pair": pa.string(),
            "event_name": pa.string(),
            "event_variant": pa.int64(),
            "event_step": pa.int64(),
        }
        parquet.write_table(
            pa.table(
                {
                    key: pa.array([episode[key] for episode in self._episodes], optional.get(key))
                    for key in self._episodes[0]
                }
            ),
            episodes,
        )
        tasks = pa.table({"task_index": pa.array(self._tasks.values()), "task": pa.array(self._tasks)})
        parquet.write_table(
            tasks.replace_schema_metadata({"pandas": json.dumps(_INDEXED_BY_TASK)}), meta / "tasks.parquet"
        )
        statistics = {
            key: feature.to_dict(image=key in IMAGES.values()) for key, feature in self._statistics.items()
        }
        _write_json(meta / "stats.json", statistics)
        _write_json(meta / "info.json", self._info())

    def _info(self) -> dict[str, Any]:
        image = {
            "dtype": "image",
            "shape": [self._side, self._side, 3],
            "names": ["height", "width", "channels"],
        }
        return {
            "codebase_version": VERSION,
            "robot_type": "panda",
            "total_episodes": len(self._episodes),
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            "chunks_size": 1000,
            "data_files_size_in_mb": FILE_BYTES // 2**20,
            "video_files_size_in_mb": 200,
            "fps": CONTROL_HZ,
            "splits": {"train": f"0:{len(self._episodes)}"},
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": None,
            "features": {
                **dict.fromkeys(IMAGES.values(), image),
                "observation.state": {"dtype": "float32", "shape": [8], "names": list(STATE)},
                "action": {"dtype": "float32", "shape": [7], "names": list(ACTION)},
                **{key: {"dtype": dtype, "shape": [1], "names": None} for key, dtype in NUMBERS.items()},
            },
        }


def states(demo: Demonstration) -> NDArray[np.float32]:
    """(T, 8): position, axis times angle, both fingers."""
    seen = demo.observations
    rotations = np.stack([axis_angle(quaternion) for quaternion in seen["robot0_eef_quat"]])
    rows = np.concatenate([seen["robot0_eef_pos"], rotations, seen["robot0_gripper_qpos"]], axis=1)
    return rows.astype(np.float32)


def _read(paths: Sequence[Path]) -> Iterator[tuple[Demonstration, dict[str, Any]]]:
    for path in paths:
        try:
            yield load(path)
        except (OSError, ValueError, KeyError, BadZipFile) as error:
            raise OptionError(
                f"{path} cannot be read ({type(error).__name__}: {error}). Remove it, and give the command "
                "again: it is recorded anew."
            ) from error


def _png(image: NDArray[np.uint8]) -> bytes:
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(image).save(content, format="png", compress_level=6)
    return content.getvalue()


def _write_json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=4) + "\n", encoding="utf-8")


_INDEXED_BY_TASK = {
    "index_columns": ["task"],
    "column_indexes": [],
    "columns": [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ],
    "pandas_version": "2.2.0",
}
"""Metadata that marks the texts as the index for pandas, with which LeRobot reads the table."""
