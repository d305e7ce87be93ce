"""Voids of the match filled from what stands around them: a hidden point belongs to the farther surface."""

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]


def _nearest_before(values: Field) -> tuple[Field, Field]:
    """For every pixel the last value that is no NaN at or before it in its row, and how far back it stands."""
    columns = np.arange(values.shape[1])[None, :]
    place = np.maximum.accumulate(np.where(np.isfinite(values), columns, -1), axis=1)
    taken = np.take_along_axis(values, np.maximum(place, 0), axis=1)
    some = place >= 0
    return np.where(some, taken, np.float32(np.nan)), np.where(some, columns - place, np.inf).astype(
        np.float32
    )


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
    turned = np.ascontiguousarray(inverse_depth.T)
    sides = [
        _nearest_before(inverse_depth),
        tuple(part[:, ::-1] for part in _nearest_before(inverse_depth[:, ::-1])),
        tuple(part.T for part in _nearest_before(turned)),
        tuple(part[:, ::-1].T for part in _nearest_before(turned[:, ::-1])),
    ]
    candidates = np.stack([side[0][void] for side in sides])
    away = np.stack([side[1][void] for side in sides])
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
    overall = np.float32(np.nanmedian(inverse_depth))
    filled, spread, reach = inverse_depth.copy(), zero, np.zeros_like(inverse_depth)
    filled[void] = np.where(lonely, overall, np.where(hidden[void], far, close))
    spread[void] = np.where(lonely, np.nanmax(inverse_depth) - np.nanmin(inverse_depth), width)
    reach[void] = np.where(lonely, np.hypot(*inverse_depth.shape), distance)
    return filled, spread, reach
