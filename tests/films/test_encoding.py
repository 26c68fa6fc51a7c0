from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture
from PIL import ImageSequence

from pytest_libero_max.errors import ProtocolError, ReportError
from pytest_libero_max.films import encoding
from pytest_libero_max.films.encoding import write_film
from pytest_libero_max.runs.media import FILM_FORMATS
from pytest_libero_max.worlds.contract import Image


def _timed(count: int = 5) -> Iterator[tuple[int, Image]]:
    return enumerate(_frames(count))


def _frames(count: int = 5) -> Iterator[Image]:
    """A white square that moves to the right."""
    for number in range(count):
        frame = np.zeros((40, 60, 3), np.uint8)
        frame[10:30, 10 * number : 10 * number + 20] = 255
        yield frame


def test_a_webp_holds_every_frame_and_lasts_as_long_as_the_episode(tmp_path: Path) -> None:
    path = tmp_path / "films" / "a.webp"
    write_film(path, _timed(), 20)
    with Picture.open(path) as film:
        shown = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]
        assert film.info["duration"] == 50
    for frame, expected in zip(shown, _frames(), strict=True):
        assert np.abs(frame.astype(int) - expected).mean() < 10


def test_an_mp4_is_h264_and_holds_every_frame(tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="the extra film")
    path = tmp_path / "a.mp4"
    write_film(path, _timed(), 20)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.average_rate) == ("h264", 20)
        shown = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
    for frame, expected in zip(shown, _frames(), strict=True):
        assert np.abs(frame.astype(int) - expected).mean() < 10


@pytest.mark.parametrize("suffix", FILM_FORMATS)
def test_the_same_frames_give_the_same_bytes(tmp_path: Path, suffix: str) -> None:
    if suffix == "mp4":
        pytest.importorskip("av", reason="the extra film")
    paths = [tmp_path / f"{name}.{suffix}" for name in "ab"]
    for path in paths:
        write_film(path, _timed(), 20)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_an_mp4_has_the_same_bytes_after_other_films(tmp_path: Path) -> None:
    """The encoder may read memory that it has not written, which holds parts of earlier films."""
    pytest.importorskip("av", reason="the extra film")
    path, draw = tmp_path / "a.mp4", np.random.default_rng(0)
    contents = []
    for size in ((96, 144), (64, 98)):
        frames = [draw.integers(0, 255, (*size, 3), np.uint8) for _ in range(12)]
        for number in range(20):
            used = [np.full(int(length), number, np.uint8) for length in draw.integers(1000, 200000, 30)]
            del used
            write_film(path, enumerate(frames), 20, overwrite=True)
            contents.append(path.read_bytes())
    assert len(set(contents)) == 2


def test_nothing_is_written_over_without_being_asked(tmp_path: Path) -> None:
    path = tmp_path / "a.webp"
    path.write_text("mine")
    with pytest.raises(ReportError, match="exists"):
        write_film(path, _timed(), 20)
    assert path.read_text() == "mine"
    write_film(path, _timed(), 20, overwrite=True)
    assert path.read_bytes()[:4] == b"RIFF"


@pytest.mark.parametrize("suffix", FILM_FORMATS)
def test_a_film_that_breaks_off_leaves_no_file(tmp_path: Path, suffix: str) -> None:
    if suffix == "mp4":
        pytest.importorskip("av", reason="the extra film")

    def broken() -> Iterator[tuple[int, Image]]:
        yield from _timed(2)
        raise ProtocolError("another state")

    with pytest.raises(ProtocolError, match="another state"):
        write_film(tmp_path / f"a.{suffix}", broken(), 20)
    assert not list(tmp_path.iterdir())


def test_without_the_extra_films_are_webp_and_an_mp4_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert encoding.available_format() == "webp"
    with pytest.raises(ReportError, match=r"pip install -e '\.\[film\]'"):
        write_film(tmp_path / "a.mp4", _timed(), 20)


def test_a_name_that_says_no_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match=r"a\.gif.*\.mp4 or \.webp"):
        write_film(tmp_path / "a.gif", _timed(), 20)


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "films").write_text("")
    with pytest.raises(ReportError, match="Cannot write"):
        write_film(tmp_path / "films" / "a.webp", _timed(), 20)


@pytest.mark.parametrize("suffix", FILM_FORMATS)
def test_a_frame_stays_until_the_step_of_the_next(tmp_path: Path, suffix: str) -> None:
    path, steps = tmp_path / f"a.{suffix}", [0, 2, 3, 20, 24]
    if suffix == "mp4":
        av = pytest.importorskip("av", reason="the extra film")
        write_film(path, zip(steps, _frames(), strict=True), 20)
        with av.open(str(path)) as container:
            assert [round(20 * frame.time) for frame in container.decode(video=0)] == steps
    else:
        write_film(path, zip(steps, _frames(), strict=True), 20)
        with Picture.open(path) as film:
            shown = [frame.info["duration"] for frame in ImageSequence.Iterator(film) if frame.load()]
        assert shown == [100, 50, 850, 200, 200]
