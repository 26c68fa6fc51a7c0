"""Compiled loops of the image corruptions, compiled at first use and kept on disk by Numba.

Each adds in one fixed order, in float64 and without fused operations, so that its result is the same, bit
for bit, as that of the whole-array formula in its docstring. Loops run along rows of pixels that are
padded with the edge's pixels, so that no inner loop has a border.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core import types
from numba.core.cgutils import ir
from numba.extending import intrinsic

from pytest_libero_max.worlds.compiling import compiled


def _mixture(lanes: int, adds: bool) -> Any:
    """Return what puts ``p * numbers[start:] + q * numbers[other:]`` into ``out[at:]``, or adds it.

    Written as vectors, because Numba does not join neighbouring operations into them.
    """

    @intrinsic  # type: ignore[untyped-decorator]
    def mixture(
        typing_context: Any, out: Any, at: Any, numbers: Any, start: Any, other: Any, p: Any, q: Any
    ) -> Any:
        signature = types.void(out, at, numbers, start, other, p, q)

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            vector = ir.VectorType(ir.DoubleType(), lanes)

            def place(array: int, offset: Any) -> Any:
                data = context.make_array(signature.args[array])(context, builder, values[array]).data
                return builder.bitcast(builder.gep(data, [offset]), vector.as_pointer())

            def spread(value: Any) -> Any:
                zero = ir.Constant(ir.IntType(32), 0)
                one = builder.insert_element(ir.Constant(vector, ir.Undefined), value, zero)
                return builder.shuffle_vector(
                    one, one, ir.Constant(ir.VectorType(ir.IntType(32), lanes), [0] * lanes)
                )

            def load(pointer: Any) -> Any:
                return builder.load(pointer, align=8)

            mixed = builder.fadd(
                builder.fmul(load(place(2, values[3])), spread(values[5])),
                builder.fmul(load(place(2, values[4])), spread(values[6])),
            )
            goal = place(0, values[1])
            builder.store(builder.fadd(load(goal), mixed) if adds else mixed, goal, align=8)
            return context.get_dummy_value()

        return signature, generate

    return mixture


_set_four = _mixture(4, adds=False)
_add_eight = _mixture(8, adds=True)


@compiled
def smear(image: Any, down: Any, across: Any, weights: Any, padded: Any, smeared: Any) -> None:
    """Write the sum over k of ``weights[k] * image[y + down[k], x + across[k]]``, edges extended.

    Args:
        image: (H, W, C) float64, C-contiguous.
        down: (K,) int64 rows.
        across: (K,) int64 columns, at least 0.
        weights: (K,) float64.
        padded: (H, (W + the largest of ``across``) * C) float64, which is written over.
        smeared: (H, W, C) float64, the result.
    """
    height, width, channels = image.shape
    taps, length = weights.size, width * channels
    _pad_right(image, padded)
    for y in range(height):
        out = smeared[y].reshape(length)
        out[:] = 0.0
        for k in range(taps):
            a, p = _shifted(padded, y + down[k], across[k] * channels, length), weights[k]
            for i in range(length):
                out[i] += p * a[i]


@compiled
def symmetric(image: Any, weights: Any, blurred: Any) -> None:
    """Write ``image`` correlated with a symmetric kernel, down and then across, to ``blurred``.

    Edges are extended.

    Of each line: the middle times its weight, then the sums of two opposite pixels times theirs, from the
    outermost pair to the innermost, as in SciPy's ``correlate1d``.

    Args:
        image: (H, W, C) float64, C-contiguous.
        weights: (R + 1,) float64: of the outermost pair first, of the middle last.
        blurred: (H, W, C) float64, C-contiguous, apart from ``image``.
    """
    height, width, channels = image.shape
    radius, length = weights.size - 1, width * channels
    rows = image.reshape(height, length)
    upright = np.empty(length)
    line = np.empty((width + 2 * radius) * channels)
    middle = weights[radius]
    for y in range(height):
        a = rows[y]
        for i in range(length):
            upright[i] = a[i] * middle
        for k in range(radius):
            a, b, p = rows[max(y - radius + k, 0)], rows[min(y + radius - k, height - 1)], weights[k]
            for i in range(length):
                upright[i] += (a[i] + b[i]) * p
        _pad(line, upright, radius, channels)
        out = blurred[y].reshape(length)
        a = line[radius * channels : radius * channels + length]
        for i in range(length):
            out[i] = a[i] * middle
        for k in range(radius):
            near, far, p = k * channels, (2 * radius - k) * channels, weights[k]
            a, b = line[near : near + length], line[far : far + length]
            for i in range(length):
                out[i] += (a[i] + b[i]) * p


_ROWS, _COLUMNS = 4, 64
"""Rows and columns that :func:`zoomed` adds up together, in memory that the nearest cache holds."""


@compiled
def zoomed(image: Any, lows: Any, parts: Any, left: Any, right: Any, wide: Any, mean: Any) -> None:
    """Write the mean of ``image`` and of its bilinear enlargements, added in their order.

    Args:
        image: (H, W, 3) float64, C-contiguous.
        lows: (F, H) int64: per enlargement, the upper of the two rows that each row mixes.
        parts: (F, H) float64: the lower one's share.
        left: (F, W) int64: the left of the two columns that each column mixes.
        right: (F, W) float64: the right one's share.
        wide: (H, W + 1, 4) float64, C-contiguous, which is written over.
        mean: (H, W, 3) float64, the result.
    """
    height, width = image.shape[:2]
    factors = lows.shape[0]
    # A pixel is four numbers, one machine vector; the fourth stays 0. Pixels above each other stand together.
    for y in range(height):
        for x in range(width + 1):
            for c in range(3):
                wide[y, x, c] = image[y, min(x, width - 1), c]
            wide[y, x, 3] = 0.0
    pixels, line = wide.reshape(wide.size), 4 * (width + 1)
    column = 4 * _ROWS
    mixed, total = np.empty((_COLUMNS + 2) * column), np.empty(_COLUMNS * column)
    for y in range(0, height, _ROWS):
        for begin in range(0, width, _COLUMNS):
            end = min(begin + _COLUMNS, width)
            for r in range(_ROWS):
                for x in range(begin, end):
                    for c in range(4):
                        total[(x - begin) * column + 4 * r + c] = wide[min(y + r, height - 1), x, c]
            for n in range(factors):
                first, last = left[n, begin], left[n, end - 1] + 2
                for r in range(_ROWS):
                    row = min(y + r, height - 1)
                    low, q = lows[n, row], parts[n, row]
                    p, above, below = 1.0 - q, low * line, min(low + 1, height - 1) * line
                    for x in range(first, last):
                        at = (x - first) * column + 4 * r
                        _set_four(mixed, at, pixels, above + 4 * x, below + 4 * x, p, q)
                columns, shares = left[n], right[n]
                for x in range(begin, end):
                    q, start = shares[x], (columns[x] - first) * column
                    for part in range(0, column, 8):
                        at, near = (x - begin) * column + part, start + part
                        _add_eight(total, at, mixed, near, near + column, 1.0 - q, q)
            for r in range(min(_ROWS, height - y)):
                for x in range(begin, end):
                    for c in range(3):
                        mean[y + r, x, c] = total[(x - begin) * column + 4 * r + c] / (factors + 1)


@compiled
def diamonds(side: Any, rough: Any, decay: Any, draws: Any) -> Any:
    """Return a plasma fractal by the diamond-square method, (side, side), 0 to 1; it tiles both ways.

    Args:
        side: A power of two.
        decay: Divisor of the roughness from one scale to the next.
        draws: (side * side - 1,) float64, uniform in 0 to 1, in the order in which they are spent.
    """
    field = np.zeros((side, side))
    spent, step = 0, side
    while step >= 2:
        half = step // 2
        span = rough - -rough
        for y in range(0, side, step):
            below = (y + step) % side
            for x in range(0, side, step):
                beside = (x + step) % side
                total = (field[y, x] + field[below, x]) + (field[y, beside] + field[below, beside])
                field[y + half, x + half] = total / 4.0 + rough * (-rough + span * draws[spent])
                spent += 1
        for y in range(0, side, step):
            above = (y - half) % side
            for x in range(0, side, step):
                middles = field[y + half, x + half] + field[above, x + half]
                total = (middles + field[y, x]) + field[y, (x + step) % side]
                field[y, x + half] = total / 4.0 + rough * (-rough + span * draws[spent])
                spent += 1
        for y in range(0, side, step):
            below = (y + step) % side
            for x in range(0, side, step):
                middles = field[y + half, x + half] + field[y + half, (x - half) % side]
                total = (middles + field[y, x]) + field[below, x]
                field[y + half, x] = total / 4.0 + rough * (-rough + span * draws[spent])
                spent += 1
        step, rough = half, rough / decay
    field -= field.min()
    return field / field.max()


@compiled
def swap(order: Any, width: Any, reach: Any, shifts: Any) -> None:
    """Swap every place of ``order``, from the last row and column, with its partner, in place.

    Args:
        order: (H * W,) integers.
        reach: Distance from the edge of the places that are visited.
        shifts: (2, places) rows and columns from a place to its partner, plus ``reach``.
    """
    height = order.size // width
    n = 0
    for y in range(height - reach, reach, -1):
        for x in range(width - reach, reach, -1):
            place = y * width + x
            partner = place + (shifts[0, n] - reach) * width + shifts[1, n] - reach
            order[place], order[partner] = order[partner], order[place]
            n += 1


@compiled
def mix(picture: Any, bad: Any, blend: Any) -> Any:
    """Return ``rint((picture + (bad - picture) * blend) * 255)`` as uint8, clipped to 0 to 255.

    Args:
        picture: (H, W, C) float64, C-contiguous, 0 to 1.
        blend: Share of ``bad``, 0 to 1.
    """
    mixed = np.empty(picture.shape, np.uint8)
    ours, theirs, out = picture.ravel(), bad.ravel(), mixed.ravel()
    for i in range(out.size):
        value = np.rint((ours[i] + (theirs[i] - ours[i]) * blend) * 255.0)
        out[i] = np.uint8(min(max(value, 0.0), 255.0))
    return mixed


@compiled
def _pad_right(image: Any, padded: Any) -> None:
    height, width, channels = image.shape
    length = width * channels
    for y in range(height):
        padded[y, :length] = image[y].reshape(length)
        for i in range(length, padded.shape[1]):
            padded[y, i] = padded[y, i - channels]


@compiled
def _pad(line: Any, row: Any, radius: Any, channels: Any) -> None:
    length = row.size
    line[radius * channels : radius * channels + length] = row
    for i in range(radius * channels):
        line[i] = row[i % channels]
        line[radius * channels + length + i] = row[length - channels + i % channels]


@compiled
def _shifted(padded: Any, y: Any, start: Any, length: Any) -> Any:
    return padded[min(max(y, 0), padded.shape[0] - 1)][start : start + length]
