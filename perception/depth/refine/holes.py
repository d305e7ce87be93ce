"""Holes of the match filled from their surroundings: an occluded point belongs to the farther surface."""

import numpy as np
from numpy.typing import NDArray

from perception.image.quantile import quantiles

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


def _run_ends(hole: Mask) -> tuple[Index, Index, Index]:
    """For every hole, row by row: its flat index, and the columns before and after the run of holes it is in."""
    width = hole.shape[1]
    flat = np.flatnonzero(hole)
    column = flat % width
    begins = np.diff(flat, prepend=-2) != 1
    begins |= column == 0
    first = np.flatnonzero(begins)
    length = np.diff(first, append=len(flat))
    before = column[first] - 1
    return flat, np.repeat(before, length), np.repeat(before + length + 1, length)


def _nearest_sides(hole: Mask) -> tuple[Index, list[tuple[Index, Field]]]:
    """The flat index of every hole, and that and the distance of the nearest known pixel to the left, to the right,
    above and below it; ∞ if there is none."""
    height, width = hole.shape
    flat, *across = _run_ends(hole)
    row, column = np.divmod(flat, width)
    flat_turned, *down = _run_ends(np.ascontiguousarray(hole.T))
    column_turned, row_turned = np.divmod(flat_turned, height)
    # Back to the order of the rows.
    ends = np.empty(hole.size, np.intp)
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


def fill_holes(inverse_depth: Field, occluded: Mask, level: Mask) -> tuple[Field, Field, Field]:
    """Fill NaN from the nearest values to the left, right, above and below.

    What is occluded lies beside the surface that hides it, along the epipolar line: it takes the farther of the two
    values on that line. Any other hole, as at the border where the other image ends, takes the nearest of the four.

    Args:
        inverse_depth: height × width, 1/m or any unit; NaN in holes.
        occluded: which holes are hidden in the other image.
        level: where the epipolar line runs rather along the row than along the column.

    Returns:
        The filled map, the spread of the candidates (greatest − least) and the distance in pixels to the
        nearest; both are 0 where nothing was filled. A map of nothing but NaN is returned as it is.
    """
    hole = ~np.isfinite(inverse_depth)
    zero = np.zeros_like(inverse_depth)
    if not hole.any() or hole.all():
        return inverse_depth, zero, zero.copy()
    flat, sides = _nearest_sides(hole)
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
    np.put(filled, flat, np.where(np.take(occluded, flat), far, close))
    np.put(spread, flat, np.fmax.reduce(candidates) - np.fmin.reduce(candidates))
    np.put(reach, flat, distance)
    if lonely.any():
        some = np.take(inverse_depth, np.flatnonzero(~hole)[::16])
        least, middle, most = quantiles(some, 0, 0.5, 1)
        np.put(filled, flat[lonely], middle)
        np.put(spread, flat[lonely], most - least)
        np.put(reach, flat[lonely], np.hypot(*inverse_depth.shape))
    return filled, spread, reach
