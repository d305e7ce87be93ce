"""The predicted map carried to the pixels of the new view by bilinear interpolation, hidden points left out.

What (2.29) does for a 3×3 neighbourhood, done backward: each pixel of the new view takes the nearest of
the points that fall on it, and looks up the map where that point's displacement leads back to.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.epipolar import Projection
from perception.depth.inverse_depth import InverseDepth

Field = NDArray[np.float32]
SAME_SURFACE = 0.04
"""Neighbours whose inverse depths differ by more than this part are not interpolated between."""


def carry_map(predicted: InverseDepth, moved: Projection) -> InverseDepth:
    """The predicted map at the pixels of the new view; NaN where nothing falls, for that has come into view.

    Args:
        predicted: ρ' and P', still at the pixels they were predicted from.
        moved: where those pixels have gone.
    """
    height, width = predicted.value.shape
    source = _nearest_source(predicted, moved)
    known = source >= 0
    place = np.where(known, source, 0)
    rows, columns = np.divmod(np.arange(height * width, dtype=np.int32), np.int32(width))
    # The displacement of the point that fell here leads back to where this pixel came from.
    back_x = (columns - moved.x.ravel()[place] + (place % width)).reshape(height, width).astype(np.float32)
    back_y = (rows - moved.y.ravel()[place] + (place // width)).reshape(height, width).astype(np.float32)
    own = predicted.value.ravel()[place].reshape(height, width)
    filled = np.nan_to_num(predicted.value, nan=-1e6)
    between = cv2.remap(filled, back_x, back_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    value = np.where(np.abs(between - own) <= SAME_SURFACE * own, between, own)
    known = known.reshape(height, width)
    void = np.float32(np.nan)
    variance = predicted.variance.ravel()[place].reshape(height, width)
    cost = predicted.cost.ravel()[place].reshape(height, width)
    return InverseDepth(
        np.where(known, value, void).astype(np.float32),
        np.where(known, variance, void).astype(np.float32),
        np.where(known, cost, np.float32(1)).astype(np.float32),
    )


def _nearest_source(predicted: InverseDepth, moved: Projection) -> NDArray[np.int32]:
    """For every pixel the number of the nearest point that falls on it, −1 for none (flat array)."""
    height, width = predicted.value.shape
    with np.errstate(invalid="ignore"):
        good = (predicted.value >= 0) & (moved.scale > 1e-3) & np.isfinite(moved.x)
        column, row = np.rint(moved.x), np.rint(moved.y)
        good &= (column >= 0) & (column < width) & (row >= 0) & (row < height)
    number = np.flatnonzero(good)
    target = (row.ravel()[number] * width + column.ravel()[number]).astype(np.int64)
    # Positive floats sort like their bits, so that the greatest key is that of the nearest point.
    bits = predicted.value.ravel()[number].view(np.int32).astype(np.int64)
    best = np.full(height * width, -1, np.int64)
    np.maximum.at(best, target, (bits << 32) | number)
    source = np.where(best >= 0, best & 0xFFFFFFFF, -1).astype(np.int32).reshape(height, width)
    _close_cracks(source)
    return source.ravel()


def _close_cracks(source: NDArray[np.int32]) -> None:
    """Where a stretched surface leaves single pixels between two of its own, take the one before (in place)."""
    crack = source < 0
    crack[:, 0] = crack[:, -1] = False
    inner = crack[:, 1:-1]
    inner &= (source[:, :-2] >= 0) & (source[:, 2:] >= 0)
    rows, columns = np.nonzero(crack)
    source[rows, columns] = source[rows, columns - 1]
    crack = source < 0
    crack[0] = crack[-1] = False
    crack[1:-1] &= (source[:-2] >= 0) & (source[2:] >= 0)
    rows, columns = np.nonzero(crack)
    source[rows, columns] = source[rows - 1, columns]
