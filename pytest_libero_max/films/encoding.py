"""Writes frames as a film: H.264 in MP4 with the extra ``film``, otherwise an animated WebP."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path

from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.media import FILM_FORMATS
from pytest_libero_max.worlds.contract import Image

INSTALL = "pip install 'pytest-libero-max[film]'"

_H264 = {"crf": "30", "preset": "veryfast", "x264-params": "mbtree=0"}
"""Without mbtree, with which the same frames may give other bytes in a process that has made films before."""
_WEBP_QUALITY = 60
_KEY_FRAMES = (30, 60)
"""Least and largest number of frames between whole frames of a WebP; the others hold differences alone. Whole
frames every few, as Pillow writes by default, make the file a third larger."""


def available_format() -> str:
    """Return the format of films here: ``mp4`` where PyAV is installed, otherwise ``webp``."""
    return "mp4" if importlib.util.find_spec("av") else "webp"


def write_film(path: Path, frames: Iterable[Image], hz: float, overwrite: bool = False) -> None:
    """Write a film; the folder is made if missing. A film that cannot be completed leaves no file.

    An MP4 takes the frames one by one. A WebP holds them all until it is written: 290 MB for 220 steps with
    pictures of 256 pixels.

    Args:
        path: Ends in ``.mp4`` or ``.webp``, which says the format.
        frames: (H, W, 3) uint8, all of one size with even sides; at least one.
        hz: Frames in a second.
        overwrite: True if a file that is there already may be replaced.

    Raises:
        ReportError: The file exists, cannot be written, or needs the extra ``film``.
    """
    kind = path.suffix.removeprefix(".")
    if kind not in FILM_FORMATS:
        raise ReportError.seen("film", str(path), ", but a film ends in .mp4 or .webp.")
    if kind == "mp4" and available_format() != "mp4":
        raise ReportError(f"An MP4 needs PyAV: {INSTALL}. Or write a .webp.")
    if path.exists() and not overwrite:
        raise ReportError(f"{path} exists. Remove it, or allow that it is overwritten.")
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        (_write_mp4 if kind == "mp4" else _write_webp)(partial, iter(frames), hz)
        os.replace(partial, path)
    except (OSError, ValueError) as error:  # PyAV's errors are of both
        raise ReportError(f"Cannot write {path}: {error}.") from error
    finally:
        with suppress(OSError):  # there is nothing to remove after a film that was completed
            partial.unlink()


def _write_mp4(path: Path, frames: Iterator[Image], hz: float) -> None:
    import av

    first = next(frames)
    height, width = first.shape[:2]
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=round(hz), options=_H264)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.thread_count = 1  # the other processors play pairs
        for frame in chain([first], frames):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode())


def _write_webp(path: Path, frames: Iterator[Image], hz: float) -> None:
    from PIL import Image as Picture  # OpenCV writes WebP too, but not in every version that is permitted

    first, *others = [Picture.fromarray(frame) for frame in frames]
    first.save(
        path,
        format="WEBP",
        save_all=True,
        append_images=others,
        duration=round(1000 / hz),
        loop=0,
        quality=_WEBP_QUALITY,
        method=2,
        kmin=_KEY_FRAMES[0],
        kmax=_KEY_FRAMES[1],
    )
