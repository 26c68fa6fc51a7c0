"""Writes frames as a film: H.264 in MP4 with the extra ``film``, otherwise an animated WebP."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from fractions import Fraction
from itertools import chain
from pathlib import Path

import numpy as np

from pytest_libero_max.errors import ReportError, install_extra
from pytest_libero_max.runs.media import FILM_FORMATS
from pytest_libero_max.worlds.contract import Image

INSTALL = install_extra("film")

_H264 = {"crf": "30", "preset": "superfast", "x264-params": "mbtree=0"}
"""Without mbtree, with which the same frames may give other bytes in a process that has made films before."""
_WEBP_QUALITY = 60
_KEY_FRAMES = (30, 60)
"""Least and largest number of frames between whole frames of a WebP; the others hold differences alone. Whole
frames every few, as Pillow writes by default, make the file a third larger."""


def available_format() -> str:
    """Return the format of films here: ``mp4`` where PyAV is installed, otherwise ``webp``."""
    return "mp4" if importlib.util.find_spec("av") else "webp"


def write_film(path: Path, frames: Iterable[tuple[int, Image]], hz: int, overwrite: bool = False) -> None:
    """Write a film; the folder is made if missing. A film that cannot be completed leaves no file.

    An MP4 takes the frames one by one. A WebP holds them all until it is written: 290 MB for 220 steps with
    pictures of 256 pixels.

    Args:
        path: Ends in ``.mp4`` or ``.webp``, which says the format.
        frames: The policy step from which each is shown, and (H, W, 3) uint8, all of one size with even
            sides; at least one.

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


def _write_mp4(path: Path, frames: Iterator[tuple[int, Image]], hz: int) -> None:
    import av

    first = next(frames)
    height, width = first[1].shape[:2]
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=hz, options=_H264)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.thread_count = 1  # the other processors play pairs
        stream.codec_context.time_base = Fraction(1, hz)
        for step, image in chain([first], frames):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts, frame.time_base = step - first[0], Fraction(1, hz)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _write_webp(path: Path, frames: Iterator[tuple[int, Image]], hz: int) -> None:
    from PIL import Image as Picture  # OpenCV writes WebP too, but not in every version that is permitted

    steps, pictures = zip(*((step, Picture.fromarray(image)) for step, image in frames), strict=True)
    shown = np.diff(steps).tolist()
    pictures[0].save(
        path,
        format="WEBP",
        save_all=True,
        append_images=pictures[1:],
        duration=[round(1000 * count / hz) for count in [*shown, *(shown[-1:] or [1])]],
        loop=0,
        quality=_WEBP_QUALITY,
        method=2,
        kmin=_KEY_FRAMES[0],
        kmax=_KEY_FRAMES[1],
    )
