"""Voids of the match filled from what stands around them: a hidden point belongs to the farther surface."""

import numpy as np
from numpy.typing import NDArray

from perception.depth.bands import share

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


def _nearest_sides(
    known: Mask, rows: Index, columns: Index
) -> list[tuple[Index, Index, NDArray[np.float32]]]:
    """Row, column and distance of the nearest known pixel to the left, right, above and below; ∞ if there is none."""
    height, width = known.shape
    across = np.arange(width, dtype=np.int32)[None, :]
    down = np.arange(height, dtype=np.int32)[:, None]
    sides: list[tuple[Index, Index, NDArray[np.float32]]] = [(rows, columns, np.empty(0, np.float32))] * 4

    def look(side: int) -> None:
        along_row, backward = side < 2, side % 2 == 1
        axis, limit, number = (1, width, across) if along_row else (0, height, down)
        # What is void counts as beyond the end from which the search comes.
        nearest = np.where(known, number, np.int32(limit if backward else -1))
        if backward:
            turned = np.flip(nearest, axis)
            np.minimum.accumulate(turned, axis=axis, out=turned)
        else:
            np.maximum.accumulate(nearest, axis=axis, out=nearest)
        place = nearest[rows, columns]
        there = (place >= 0) & (place < limit)
        inside = np.clip(place, 0, limit - 1).astype(np.intp)
        away = np.abs(inside - (columns if along_row else rows))
        distance = np.where(there, away, np.inf).astype(np.float32)
        sides[side] = (rows, inside, distance) if along_row else (inside, columns, distance)

    share(look, range(4))
    return sides


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
    rows, columns = np.nonzero(void)
    sides = _nearest_sides(~void, rows, columns)
    away = np.stack([distance for _, _, distance in sides])
    candidates = np.stack([inverse_depth[row, column] for row, column, _ in sides])
    candidates[~np.isfinite(away)] = np.nan
    column = np.arange(candidates.shape[1])
    close = candidates[np.argmin(away, axis=0), column]
    distance = np.min(away, axis=0)
    along = np.where(
        level[void], np.fmin(candidates[0], candidates[1]), np.fmin(candidates[2], candidates[3])
    )
    count = np.isfinite(candidates).sum(axis=0)
    far = np.where(np.isfinite(along), along, close)
    width = np.fmax.reduce(candidates) - np.fmin.reduce(candidates)
    lonely = count == 0
    filled, spread, reach = inverse_depth.copy(), zero, np.zeros_like(inverse_depth)
    filled[void] = np.where(hidden[void], far, close)
    spread[void] = width
    reach[void] = distance
    if lonely.any():
        places = rows[lonely], columns[lonely]
        filled[places] = np.float32(np.nanmedian(inverse_depth))
        spread[places] = np.nanmax(inverse_depth) - np.nanmin(inverse_depth)
        reach[places] = np.hypot(*inverse_depth.shape)
    return filled, spread, reach
