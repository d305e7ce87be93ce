"""The forward–backward check: the other picture must choose the same plane for the point it was sent."""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.epipolar import Epipolar, Projection
from perception.depth.scanline import Volume

Mask = NDArray[np.bool_]
NO_VIEW = 32_000
"""Cost where a plane of the base view does not reach the other picture."""


def backward_planes(total: Volume, geometry: Epipolar, planes: NDArray[np.float64]) -> NDArray[np.int32]:
    """The cheapest plane of every pixel of the *other* picture (height × width).

    The costs need not be computed again: on each plane the homography says which base pixel a pixel
    of the other picture meets.
    """
    height, _, width = total.shape
    best = np.full((height, width), np.iinfo(np.int32).max, np.int32)
    for k, inverse_depth in enumerate(planes):
        seen = cv2.warpPerspective(
            np.ascontiguousarray(total[:, k]),
            geometry.homography(float(inverse_depth)),
            (width, height),
            flags=cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=NO_VIEW,
        ).astype(np.int32)
        seen <<= 9
        seen |= k
        np.minimum(best, seen, out=best)
    return best & 511


def agree(
    plane: NDArray[np.intp], backward: NDArray[np.int32], projection: Projection, tolerance: int = 1
) -> Mask:
    """Which base pixels the other picture confirms.

    Args:
        plane: the plane chosen in the base view; projection: where that puts each pixel.
        backward: the planes chosen in the other view.
        tolerance: how many planes the two may differ.

    Returns:
        confirmed, height × width.
    """
    height, width = plane.shape
    x, y = np.nan_to_num(projection.x, nan=-9.0), np.nan_to_num(projection.y, nan=-9.0)
    column, row = np.rint(x).astype(np.intp), np.rint(y).astype(np.intp)
    in_view = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    there = backward[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    return np.asarray(in_view & (np.abs(there - plane) <= tolerance))
