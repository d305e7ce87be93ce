"""Voids of the match filled from what stands around them: a hidden point belongs to the farther surface."""

import numpy as np
from numpy.typing import NDArray

from perception.image.quantile import quantiles

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


def _run_ends(void: Mask) -> tuple[Index, Index, Index]:
    """For every void, row by row: its flat index, and the columns before and after the run of voids it is in."""
    width = void.shape[1]
    flat = np.flatnonzero(void)
    column = flat % width
    begins = np.diff(flat, prepend=-2) != 1
    begins |= column == 0
    first = np.flatnonzero(begins)
    length = np.diff(first, append=len(flat))
    before = column[first] - 1
    return flat, np.repeat(before, length), np.repeat(before + length + 1, length)


def _nearest_sides(void: Mask) -> tuple[Index, list[tuple[Index, Field]]]:
    """The flat index of every void, and that and the distance of the nearest known pixel to the left, to the right,
    above and below it; ∞ if there is none."""
    height, width = void.shape
    flat, *across = _run_ends(void)
    row, column = np.divmod(flat, width)
    flat_turned, *down = _run_ends(np.ascontiguousarray(void.T))
    column_turned, row_turned = np.divmod(flat_turned, height)
    # Back to the order of the rows.
    ends = np.empty(void.size, np.intp)
    sides = []

    def add(end: Index, place: Index, limit: int, begin: Index, step: int) -> None:
        away = np.abs(end - place).astype(np.float32)
        away[(end < 0) | (end >= limit)] = np.inf
        sides.append((begin + step * np.clip(end, 0, limit - 1), away))

    for end in across:
        add(end, column, width, flat - column, 1)
    for end in down:
        ends[row_turned * width + column_turned] = end
        add(ends[flat], row, height, column, width)
    return flat, sides


def fill_voids(inverse_depth: Field, hidden: Mask, level: Mask) -> tuple[Field, Field, Field]:
    """Fill NaN from the nearest values to the left, right, above and below.

    What is hidden lies beside the surface that hides it, along the epipolar line: it takes the farther of the two
    values on that line. Any other void, as at the border where the other picture ends, takes the nearest in the
    picture.

    Args:
        inverse_depth: NaN where it is void.
        hidden: which voids are hidden from the other picture.
        level: where the epipolar line runs rather along the row than along the column.

    Returns:
        The filled map, the spread of the candidates (greatest − least) and the distance in pixels to the
        nearest; both are 0 where nothing was filled. A map of nothing but NaN comes back as it is.
    """
    void = ~np.isfinite(inverse_depth)
    zero = np.zeros_like(inverse_depth)
    if not void.any() or void.all():
        return inverse_depth, zero, zero.copy()
    flat, sides = _nearest_sides(void)
    candidates = [
        np.where(np.isfinite(away), np.take(inverse_depth, index), np.float32(np.nan))
        for index, away in sides
    ]
    close, distance = candidates[0], sides[0][1]
    for candidate, (_, away) in zip(candidates[1:], sides[1:], strict=True):
        close = np.where(away < distance, candidate, close)
        distance = np.minimum(distance, away)
    left, right, above, below = candidates
    along = np.where(np.take(level, flat), np.fmin(left, right), np.fmin(above, below))
    far = np.where(np.isfinite(along), along, close)
    lonely = np.isinf(distance)
    filled, spread, reach = inverse_depth.copy(), zero, np.zeros_like(inverse_depth)
    np.put(filled, flat, np.where(np.take(hidden, flat), far, close))
    np.put(spread, flat, np.fmax.reduce(candidates) - np.fmin.reduce(candidates))
    np.put(reach, flat, distance)
    if lonely.any():
        some = np.take(inverse_depth, np.flatnonzero(~void)[::16])
        least, middle, most = quantiles(some, 0, 0.5, 1)
        np.put(filled, flat[lonely], middle)
        np.put(spread, flat[lonely], most - least)
        np.put(reach, flat[lonely], np.hypot(*inverse_depth.shape))
    return filled, spread, reach
