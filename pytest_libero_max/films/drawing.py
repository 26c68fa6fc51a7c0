"""Draws the frames of a film: an arm a column, a camera a row, words above and curves below."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from pytest_libero_max.errors import counted
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.films.replay import Tick
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.pairing.trace import ArmTrace
from pytest_libero_max.report.happenings import Happening, arm_title, happenings
from pytest_libero_max.report.palette import (
    EVENT,
    EVENT_INK,
    GAIN,
    GRID,
    INK,
    LOSS,
    MUTED,
    PAPER,
    STALE,
    arm_colors,
)
from pytest_libero_max.runs.media import distinct_arms
from pytest_libero_max.worlds.contract import Image

_OLD_PLACE = "#ffd447"

_BLINK_STEPS = 3
_GAP_PX = 4
_OUTCOMES = {
    "preserved_success": "both succeed",
    "change_associated_success": "gain: only Dynamic succeeds",
    "regression": "regression: only Base succeeds",
    "persistent_failure": "neither succeeds",
}


@dataclass(frozen=True)
class Label:
    """Some words on a coloured ground, in a corner of a picture."""

    words: str
    color: str


def labels(record: PairRecord, name: str, step: int, shared_until: int) -> list[Label]:
    """Return the words in the picture of an arm after a number of policy steps."""
    arm = record.arms[name]
    steps = arm.steps
    result: list[Label] = []
    if step < shared_until:
        result.append(Label("shared prefix", MUTED))
    happened = Counter(
        _words_of(happening, record.variant)
        for happening in happenings(record, arm)
        if happening.firing.step <= step < happening.firing.step + record.control_hz
    )
    result += [
        Label(what if times == 1 else f"{what}, {times} times", EVENT) for what, times in happened.items()
    ]
    if arm.firings and arm.stale_actions:
        begin = arm.firings[0].step
        if begin < step <= begin + arm.stale_actions and step <= steps:
            result.append(Label(f"stale action {step - begin} of {arm.stale_actions}", EVENT_INK))
    if step >= steps:
        ended = f"{'success' if arm.success else 'failed'} after {counted(steps, 'step')}"
        result.append(Label(ended, GAIN if arm.success else LOSS))
    return result


def _words_of(happening: Happening, variant: int) -> str:
    if happening.reverts:
        return "EVENT taken back"
    return f"EVENT {happening.name} v{variant}" if happening.is_event else f"EVENT {happening.name}"


def film_frames(
    record: PairRecord,
    traces: Mapping[str, ArmTrace],
    ticks: Iterable[Tick],
    size: int,
    caption: str | None = None,
) -> Iterator[tuple[int, Image]]:
    """Yield the frames of a film: the policy step of each, and (height, width, 3) uint8 with even sides.

    While nothing new is to be seen, a frame stays for up to a second.

    Args:
        caption: Kind of the pictures, where they are not those of the world's cameras; then each has its
            name below.
    """
    canvas = _Canvas(record, traces, size, caption)
    shown: Tick | None = None
    waiting: Tick | None = None
    for tick in ticks:
        canvas.follow(tick)
        waiting = tick
        if shown is None or tick.step - shown.step >= record.control_hz or canvas.is_new(shown, tick):
            yield tick.step, canvas.draw(tick)
            shown, waiting = tick, None
    if waiting is not None:
        yield waiting.step, canvas.draw(waiting)


def shared_steps(record: PairRecord, names: Sequence[str]) -> int:
    """Policy steps before the first thing that happens in one of the arms, or before an arm ends.

    Arms of another repetition share nothing, though they may do the same.
    """
    arms = [record.arms[name] for name in names]
    if len({arm.repetition for arm in arms}) > 1 or len(arms) == 1:
        return 0
    firings = [firing.step for arm in arms for firing in arm.firings]
    return min([*firings, *(arm.steps for arm in arms)])


class _Canvas:
    """A film's fixed parts, and the curves as far as they have got."""

    def __init__(
        self, record: PairRecord, traces: Mapping[str, ArmTrace], size: int, caption: str | None
    ) -> None:
        self._record, self._size, self._caption = record, size, caption
        self._names = distinct_arms(record)
        self._shared = shared_steps(record, self._names)
        self._steps = max(record.arms[name].steps for name in self._names)
        self._distances = {name: _distances(traces[name]) for name in self._names}
        self._ways: dict[str, list[tuple[float, float]]] = {}
        self._queries = {name: traces[name].query_steps.tolist() for name in self._names}
        self._openings: dict[str, list[tuple[int, float]]] = {name: [] for name in self._names}
        self._font_px = _font_px(size)
        self._line_px = _line_px(size)
        self._width = _even(max(len(self._names) * (size + _GAP_PX) - _GAP_PX, size))
        self._title = self._title_lines()

    def follow(self, tick: Tick) -> None:
        """Take a moment into the curves. Moments come in their order."""
        for name, view in tick.views.items():
            if tick.step <= self._record.arms[name].steps:
                self._openings[name].append((tick.step, view.opening_m))

    def is_new(self, shown: Tick, tick: Tick) -> bool:
        """Return True if a moment has another picture or other words than the one that is shown."""
        return any(
            view.words != shown.views[name].words
            or self._marks(name, tick.step) != self._marks(name, shown.step)
            or any(image is not shown.views[name].images.get(title) for title, image in view.images.items())
            for name, view in tick.views.items()
        )

    def _marks(self, name: str, step: int) -> object:
        since = self._since_event(self._record.arms[name], step)
        blink = since is not None and since < _BLINK_STEPS
        return labels(self._record, name, step, self._shared), since is None, blink

    def draw(self, tick: Tick) -> Image:
        cameras = next(iter(tick.views.values())).images
        top = len(self._title) * self._line_px + 6
        pictures = self._line_px + 4 + len(cameras) * (self._size + _GAP_PX)
        strip = strip_px(self._size)
        frame = Picture.new("RGB", (self._width, _even(top + pictures + strip)), PAPER)
        pen = ImageDraw.Draw(frame)
        for number, (words, color) in enumerate(self._title):
            self._write(pen, (4, 3 + number * self._line_px), words, color)
        for column, name in enumerate(self._names):
            x = column * (self._size + _GAP_PX)
            self._draw_arm(frame, pen, (x, top), name, tick)
        self._draw_strip(pen, top + pictures, strip, tick.step)
        return np.array(frame)

    def _title_lines(self) -> list[tuple[str, str]]:
        record = self._record
        policy = record.policy
        asked = f"chunk of {policy.get('horizon')}, {policy.get('query_interval')} executed"
        outcome = _OUTCOMES[record.outcome] if {BASE, DYNAMIC} <= record.arms.keys() else "arms of a study"
        if record.arms.keys() >= {BASE, DYNAMIC} and not record.triggered:
            outcome += "; the event never happened"
        lines = [
            (record.item_id, INK),
            (record.instruction, MUTED),
            (f"{policy.get('name')} ({asked})", MUTED),
            (outcome, INK),
        ]
        if self._caption is not None:
            lines.append((self._caption, EVENT_INK))
        return [(part, color) for words, color in lines for part in self._wrapped(words)]

    def _draw_arm(
        self, frame: Picture.Image, pen: ImageDraw.ImageDraw, corner: tuple[int, int], name: str, tick: Tick
    ) -> None:
        arm, (x, y), size = self._record.arms[name], corner, self._size
        color = self._color(name)
        self._write(pen, (x + 4, y), arm_title(name, arm), color)
        count = f"{min(tick.step, arm.steps)}"
        self._write(pen, (x + size - 4 - self._length(count), y), count, MUTED)
        y += self._line_px + 4
        top = y
        ended = tick.step >= arm.steps
        view = tick.views[name]
        for camera, image in view.images.items():
            picture = Picture.fromarray(_faded(image) if ended else np.ascontiguousarray(image))
            for outline in view.outlines.get(camera, ()):
                self._outline(ImageDraw.Draw(picture), outline)
            frame.paste(picture, (x, y))
            y += size + _GAP_PX
        box = (x, top, x + size - 1, y - _GAP_PX - 1)
        since = self._since_event(arm, tick.step)
        if tick.step < self._shared:
            pen.rectangle(box, outline=MUTED, width=2)
        elif since is not None:
            blink = since < _BLINK_STEPS
            pen.rectangle(box, outline=EVENT, width=max(4, size // (16 if blink else 40)))
        if self._caption is not None:
            for number, title in enumerate(view.images, start=1):
                below = top + number * (size + _GAP_PX) - _GAP_PX - self._line_px - 6
                self._label(pen, (x + 6, below), Label(title, MUTED))
        words_shown = [Label(words, INK) for words in view.words]
        for number, label in enumerate([*words_shown, *labels(self._record, name, tick.step, self._shared)]):
            self._label(pen, (x + 6, top + 6 + number * (self._line_px + 4)), label)

    def _outline(self, pen: ImageDraw.ImageDraw, corners: NDArray[np.int32]) -> None:
        """Draw the old place of a thing, legible on any ground."""
        closed = [(int(x), int(y)) for x, y in (*corners, corners[0], corners[1 % len(corners)])]
        thin = max(1, self._size // 128)
        for color, width in ((INK, thin + 2), (_OLD_PLACE, thin)):
            pen.line(closed, fill=color, width=width)

    def _label(self, pen: ImageDraw.ImageDraw, place: tuple[int, int], label: Label) -> None:
        length = self._length(label.words)
        pen.rectangle((*place, place[0] + length + 8, place[1] + self._line_px), fill=label.color)
        self._write(pen, (place[0] + 4, place[1] + 1), label.words, PAPER)

    def _since_event(self, arm: ArmRecord, step: int) -> int | None:
        since = [step - firing.step for firing in arm.firings]
        return min((steps for steps in since if 0 <= steps < arm.control_hz), default=None)

    def _draw_strip(self, pen: ImageDraw.ImageDraw, top: int, height: int, step: int) -> None:
        line = self._line_px
        left, right = 8, self._width - 8
        distances = _Plot(
            left,
            top + line,
            right,
            top + int(height * 0.6),
            self._steps,
            max((float(values.max()) for values in self._distances.values() if values.size), default=1.0),
        )
        fingers = _Plot(
            left,
            top + int(height * 0.6) + line + 4,
            right,
            top + height - 8,
            self._steps,
            max([0.08, *(opening for part in self._openings.values() for _, opening in part)]),
        )
        self._draw_marks(pen, distances, fingers, step)
        distance = f"distance to {self._record.trigger_entity}"
        titles = (f"{distance} (ticks: queries)", distance, "distance"), ("gripper opening",)
        for plot, words in zip((distances, fingers), titles, strict=True):
            above, highest = plot.top - line - 2, f"0 to {plot.highest:.2f} m"
            room = right - left - self._length(f"{highest}  ")
            fitting = next((title for title in words if self._length(title) <= room), words[-1])
            self._write(pen, (left, above), fitting, MUTED)
            self._write(pen, (right - self._length(highest), above), highest, MUTED)
        for number, name in enumerate(self._names):
            color, values = self._color(name), self._distances[name]
            if name not in self._ways:
                self._ways[name] = [distances.at(at, value) for at, value in enumerate(values, start=1)]
            pen.line(self._ways[name][: min(step, len(values))], fill=color, width=2)
            pen.line([fingers.at(*point) for point in self._openings[name]], fill=color, width=2)
            for query in self._queries[name]:
                if query <= step:
                    x, _ = distances.at(query, 0.0)
                    y = distances.bottom - 5 * (number + 1)
                    pen.line([(x, y), (x, y + 4)], fill=color)

    def _draw_marks(self, pen: ImageDraw.ImageDraw, distances: _Plot, fingers: _Plot, step: int) -> None:
        for plot in (distances, fingers):
            for name in self._names:
                arm = self._record.arms[name]
                if arm.firings and arm.stale_actions and arm.firings[0].step < step:
                    begin = arm.firings[0].step
                    end = min(begin + arm.stale_actions, step)
                    pen.rectangle(
                        (plot.at(begin, 0)[0], plot.top, plot.at(end, 0)[0], plot.bottom), fill=STALE
                    )
                for firing in arm.firings:
                    if firing.step <= step:
                        x, _ = plot.at(firing.step, 0.0)
                        pen.line([(x, plot.top), (x, plot.bottom)], fill=EVENT, width=2)
            pen.line([(plot.left, plot.bottom), (plot.right, plot.bottom)], fill=GRID)
            x, _ = plot.at(step, 0.0)
            pen.line([(x, plot.top), (x, plot.bottom)], fill=MUTED)

    def _color(self, name: str) -> str:
        return arm_colors(self._names)[name]

    def _write(self, pen: ImageDraw.ImageDraw, place: tuple[float, float], words: str, color: str) -> None:
        pen.bitmap((round(place[0]), round(place[1])), _written(words, self._font_px), fill=color)

    def _length(self, words: str) -> int:
        return _length(words, self._font_px)

    def _wrapped(self, words: str) -> list[str]:
        """Return a text in lines that fit the film; a word that does not fit is cut."""
        lines, line = [], ""
        for char in words:
            if self._length(line + char) > self._width - 8:
                cut = max(line.rfind(" "), line.rfind("-")) + 1 or len(line)
                lines.append(line[:cut])
                line = line[cut:]
            line += char
        return [*lines, line]


@dataclass(frozen=True)
class _Plot:
    """A place for curves: left, top, right and bottom in pixels, over steps and values from 0."""

    left: int
    top: int
    right: int
    bottom: int
    steps: int
    highest: float

    def at(self, step: float, value: float) -> tuple[float, float]:
        x = self.left + (self.right - self.left) * step / max(self.steps, 1)
        y = self.bottom - (self.bottom - self.top) * value / self.highest
        return round(x), round(y)


def _distances(trace: ArmTrace) -> NDArray[np.float64]:
    if not len(trace.actions):
        return np.zeros(0)
    distances: NDArray[np.float64] = np.linalg.norm(trace.end_effector - trace.entity, axis=1)
    return distances


def _faded(image: Image) -> Image:
    """Return an image halfway to white: nothing happens in it any more."""
    return (image // 2 + 127).astype(np.uint8)


def strip_px(size: int) -> int:
    """Height of the curves below pictures of this size, pixels."""
    return max(4 * size // 5, 5 * _line_px(size))


def _font_px(size: int) -> int:
    return max(9, size // 18)


def _line_px(size: int) -> int:
    return _font_px(size) + 5


def _even(length: int) -> int:
    return length + length % 2


@lru_cache(maxsize=4096)
def _written(words: str, size_px: int) -> Picture.Image:
    """Words as a mask. The same words come back in every frame, and writing them takes the longest."""
    mask = Picture.new("L", (_length(words, size_px) + 2, 2 * size_px))
    ImageDraw.Draw(mask).text((0, 0), words, fill=255, font=_font(size_px))
    return mask


@lru_cache(maxsize=4096)
def _length(words: str, size_px: int) -> int:
    return int(_font(size_px).getlength(words))


@cache
def _font(size_px: int) -> Any:
    """Return the font that comes with Pillow: the same on every machine."""
    return ImageFont.load_default(size=size_px)
