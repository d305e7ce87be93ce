"""Voids of the match filled from what stands around them: a hidden point belongs to the farther surface."""

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]


def _nearest_before(values: Field) -> Field:
    """For every pixel the last value that is no NaN at or before it in its row; NaN where there is none."""
    width = values.shape[1]
    place = np.where(np.isfinite(values), np.arange(width)[None, :], -1)
    place = np.maximum.accumulate(place, axis=1)
    taken = np.take_along_axis(values, np.maximum(place, 0), axis=1)
    return np.where(place >= 0, taken, np.float32(np.nan))


def fill_voids(inverse_depth: Field) -> tuple[Field, Field]:
    """Fill NaN by the second farthest of the nearest values to the left, right, above and below.

    The farthest alone would spread every stray point that is too far.

    Returns:
        The filled map and the spread of the four candidates (greatest − least, 0 where nothing was filled),
        which says how uncertain the choice is. A map of nothing but NaN comes back as it is.
    """
    void = ~np.isfinite(inverse_depth)
    if not void.any() or void.all():
        return inverse_depth, np.zeros_like(inverse_depth)
    turned = np.ascontiguousarray(inverse_depth.T)
    candidates = np.stack(
        [
            _nearest_before(inverse_depth),
            _nearest_before(inverse_depth[:, ::-1])[:, ::-1],
            _nearest_before(turned).T,
            _nearest_before(turned[:, ::-1])[:, ::-1].T,
        ]
    )[:, void]
    candidates.sort(axis=0)
    count = np.isfinite(candidates).sum(axis=0)
    column = np.arange(candidates.shape[1])
    least = candidates[0]
    greatest = candidates[np.maximum(count - 1, 0), column]
    chosen = candidates[np.where(count >= 2, 1, 0), column]
    overall = np.float32(np.nanmedian(inverse_depth))
    filled = inverse_depth.copy()
    filled[void] = np.where(count > 0, chosen, overall)
    spread = np.zeros_like(inverse_depth)
    spread[void] = np.where(count > 0, greatest - least, np.float32(np.nanmax(inverse_depth) - overall))
    return filled, spread
