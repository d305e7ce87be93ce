"""The cost of every depth hypothesis at every pixel: both pictures brought together on a fan of planes.

For the plane at inverse depth ρ_k the other picture is warped by its homography, and the difference of
the equalised slopes is summed over the window φ of (2.6). The candidates of a pixel are then the
points of its epipolar line.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.epipolar import Epipolar
from perception.depth.inverse_depth import InverseDepth

Bytes = NDArray[np.uint8]
Volume = NDArray[np.int16]
Matrix = NDArray[np.float64]
Picture = NDArray[Any]

WORST = 510
"""The greatest cost of a pixel: two slopes that differ by the whole range."""
WINDOWS = (3, 7)
"""Sides of the two windows whose means are averaged: the small one finds the edges, the large one bears noise."""


def sweep_planes(base: Bytes, other: Bytes, geometry: Epipolar, planes: NDArray[np.float64]) -> Volume:
    """Matching costs, 0 (alike) to 510, of the base pixels on each plane.

    Args:
        base, other: equalised slopes, height × width × 2.
        geometry: from the base view to the other.
        planes: inverse depths, 1/m.

    Returns:
        height × planes × width, so that one row with all its planes lies together.
    """
    height, width = base.shape[:2]
    costs = np.empty((height, len(planes), width), np.int16)
    small, large = ((side, side) for side in WINDOWS)
    for k, inverse_depth in enumerate(planes):
        warped = warp_plane(other, geometry.homography(float(inverse_depth)), cv2.INTER_LINEAR, 127)
        difference = cv2.absdiff(base, warped)
        mean = cv2.addWeighted(cv2.blur(difference, small), 0.5, cv2.blur(difference, large), 0.5, 0)
        pair = mean.view(np.uint16)[..., 0]
        cost = pair >> 8
        pair &= 255
        np.add(cost, pair, out=costs[:, k], casting="unsafe")
    return costs


def warp_plane(image: Picture, homography: Matrix, interpolation: int, outside: int) -> Picture:
    """The picture seen through a homography from the result's pixels to the picture's; `outside` where it ends."""
    size = (image.shape[1], image.shape[0])
    flags = interpolation | cv2.WARP_INVERSE_MAP
    border, value = cv2.BORDER_CONSTANT, (outside, outside)
    # A camera that neither turns nor moves forward gives affine maps, which cost less.
    if np.abs(homography[2] / homography[2, 2] - (0, 0, 1)).max() < 1e-12:
        affine = homography[:2] / homography[2, 2]
        return np.asarray(
            cv2.warpAffine(image, affine, size, flags=flags, borderMode=border, borderValue=value)
        )
    return np.asarray(
        cv2.warpPerspective(image, homography, size, flags=flags, borderMode=border, borderValue=value)
    )


def admit_prediction(
    costs: Volume, planes: NDArray[np.float64], predicted: InverseDepth, stiffness: float
) -> None:
    """Let the predicted depth stand for the pictures no longer kept: costs ← min(costs, c + stiffness·χ²), in place.

    c is what the prediction cost when it was last confirmed and χ² = (ρ_k − ρ̂)²/P, P at least a
    quarter of a squared plane distance. So a point hidden from the other picture keeps the depth it had, and
    one that the other picture shows better takes a new one. A guess (cost 1) or a void (NaN) admits nothing.
    """
    spacing = float(planes[1] - planes[0])
    known = np.isfinite(predicted.value) & (predicted.cost < 1)
    place = np.where(known, (predicted.value - planes[0]) / spacing, 0).astype(np.float32)
    spread = np.where(known, predicted.variance / np.float32(spacing**2), 0) + np.float32(0.25)
    slope = np.sqrt(np.float32(stiffness * WORST) / spread).astype(np.float32)
    floor = np.where(known, predicted.cost, np.float32(1)) * np.float32(WORST)
    away, cost = np.empty_like(place), np.empty(place.shape, np.int16)
    for k in range(len(planes)):
        np.subtract(place, np.float32(k), out=away)
        away *= slope
        away *= away
        away += floor
        np.minimum(away, np.float32(WORST), out=away)
        np.copyto(cost, away, casting="unsafe")
        np.minimum(costs[:, k], cost, out=costs[:, k])
