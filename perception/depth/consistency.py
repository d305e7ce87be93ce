"""The forward–backward check: the other picture must choose the same plane for the point it was sent."""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.epipolar import Epipolar, Projection
from perception.depth.scanline import Volume
from perception.depth.sweep import warp_plane

Mask = NDArray[np.bool_]
THINNING = 2
NO_VIEW = 32_000
"""Cost where a plane of the base view does not reach the other picture."""


def backward_planes(total: Volume, geometry: Epipolar, planes: NDArray[np.float64]) -> NDArray[np.int32]:
    """The cheapest plane of every second pixel, both ways, of the *other* picture.

    The costs need not be computed again: on each plane the homography says which base pixel a pixel
    of the other picture meets.
    """
    half = np.diag([1 / THINNING, 1 / THINNING, 1.0])
    thin = total[::THINNING, :, ::THINNING]
    height, _, width = thin.shape
    best = np.full((height, width), np.iinfo(np.int32).max, np.int32)
    for k, inverse_depth in enumerate(planes):
        backward = np.linalg.inv(half @ geometry.homography(float(inverse_depth)) @ np.linalg.inv(half))
        costs = np.ascontiguousarray(thin[:, k])
        seen = warp_plane(costs, np.asarray(backward, np.float64), cv2.INTER_NEAREST, NO_VIEW).astype(
            np.int32
        )
        seen <<= 9
        seen |= k
        np.minimum(best, seen, out=best)
    return best & 511


def agree(
    plane: NDArray[np.int16], backward: NDArray[np.int32], projection: Projection, tolerance: int = 1
) -> Mask:
    """Which base pixels the other picture confirms.

    Args:
        plane: the plane chosen in the base view; projection: where that puts each pixel.
        backward: the planes chosen in the other view, as `backward_planes` gives them.
        tolerance: how many planes the two may differ.

    Returns:
        confirmed, height × width.
    """
    height, width = backward.shape
    x, y = (np.nan_to_num(place / THINNING, nan=-9.0) for place in (projection.x, projection.y))
    column, row = np.rint(x).astype(np.intp), np.rint(y).astype(np.intp)
    in_view = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    there = backward[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    return np.asarray(in_view & (np.abs(there - plane) <= tolerance))
