"""The cost of every depth hypothesis at every pixel: both pictures brought together on a fan of planes.

For the plane at inverse depth ρ_k the other picture is warped by its homography, and the difference of
the equalised slopes is summed over the window φ of (2.6). The candidates of a pixel are then the
points of its epipolar line.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.epipolar import Epipolar
from perception.depth.inverse_depth import InverseDepth

Bytes = NDArray[np.uint8]
Volume = NDArray[np.int16]

WORST = 510
"""The greatest cost of a pixel: two slopes that differ by the whole range."""
WINDOWS = (3, 7)
"""Sides of the two windows whose means are averaged: the small one finds the edges, the large one bears noise."""
WARP = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP


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
        warped = cv2.warpPerspective(
            other,
            geometry.homography(float(inverse_depth)),
            (width, height),
            flags=WARP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(127, 127),
        )
        difference = cv2.absdiff(base, warped)
        mean = cv2.addWeighted(cv2.blur(difference, small), 0.5, cv2.blur(difference, large), 0.5, 0)
        pair = mean.view(np.uint16)[..., 0]
        costs[:, k] = (pair & 255) + (pair >> 8)
    return costs


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
    for k in range(len(planes)):
        away = (place - np.float32(k)) * slope
        away *= away
        away += floor
        np.minimum(away, WORST, out=away)
        np.minimum(costs[:, k], away.astype(np.int16), out=costs[:, k])
