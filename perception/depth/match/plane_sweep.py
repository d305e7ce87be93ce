"""The cost of every depth hypothesis at every pixel: both images brought together on a fan of planes.

For the plane at inverse depth ρ_k the other image is warped by its homography, and the difference of
the equalised slopes is summed over the window φ of (2.6). The candidates of a pixel are then the
points of its epipolar line.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Epipolar
from perception.image.bands import Band, bands, share
from perception.image.plane_warp import find_shift, shift_image, warp_image
from perception.image.select import select

Bytes = NDArray[np.uint8]
Volume = NDArray[np.uint8]

WORST = 102
"""The greatest cost of a pixel: two slopes that differ by the whole range. 2½ times as much is a byte, which is what
a path of the scanline aggregation adds up to with a P2 of 1½."""
FULL = 254
"""The range of a slope."""
WINDOWS = (3, 7)
"""Sides of the two windows whose means are averaged: the small one finds the edges, the large one bears noise."""


def sweep_planes(base: Bytes, other: Bytes, geometry: Epipolar, planes: NDArray[np.float64]) -> Volume:
    """Matching costs, 0 (alike) to `WORST`, of the base pixels on each plane.

    Args:
        base, other: equalised slopes, 2 × height × width.
        geometry: from the base view to the other.
        planes: inverse depths, 1/m.

    Returns:
        planes × height × width.
    """
    height, width = base.shape[1:]
    # OpenCV warps four channels in little more time than one, and two in more than four.
    four, four_other = (cv2.merge((*slopes, *slopes)) for slopes in (base, other))
    costs = np.empty((len(planes), height, width), np.uint8)
    homographies = geometry.homographies(planes)
    small, large = ((side, side) for side in WINDOWS)

    def compare(k: int) -> None:
        shift = find_shift(homographies[k])
        if shift is None:
            apart = cv2.absdiff(four, warp_image(four_other, homographies[k], cv2.INTER_LINEAR, FULL // 2))
            across, down = cv2.extractChannel(apart, 0), cv2.extractChannel(apart, 1)
        else:
            across, down = (
                cv2.absdiff(here, shift_image(there, *shift, FULL // 2))
                for here, there in zip(base, other, strict=True)
            )
        difference = cv2.addWeighted(across, 0.5, down, 0.5, 0)
        part = WORST / FULL / 2
        cv2.addWeighted(cv2.blur(difference, small), part, cv2.blur(difference, large), part, 0, dst=costs[k])

    share(compare, range(len(planes)), height * width)
    return costs


def admit_prediction(
    costs: Volume, planes: NDArray[np.float64], predicted: InverseDepth, stiffness: float
) -> Volume:
    """Let the predicted depth represent the images no longer kept: min(costs, c + stiffness·χ²).

    c is what the prediction cost when it was last confirmed and χ² = (ρ_k − ρ̂)²/P, P at least a
    quarter of a squared plane distance. So a point that is occluded in the other image keeps the depth it had, and
    one that the other image shows better takes a new one. A guess (cost 1) or a hole (NaN) changes nothing.

    Args:
        costs: planes × height × width, 0 to `WORST`.
        planes: inverse depths, evenly spaced, 1/m.
        predicted: ρ̂, P and c, height × width.
    """
    spacing = float(planes[1] - planes[0])
    worst = np.float32(WORST)
    admitted = np.empty_like(costs)

    def admit(band: Band) -> None:
        value, variance, lowest = (
            part[band.inner] for part in (predicted.value, predicted.variance, predicted.cost)
        )
        known = np.isfinite(value) & (lowest < 1)
        place = select(known, (value - np.float32(planes[0])) / np.float32(spacing), 0)
        with np.errstate(over="ignore"):
            spread = select(known, variance / np.float32(spacing**2), 0) + np.float32(0.25)
        slope = np.sqrt(np.float32(stiffness * WORST) / spread)
        floor = select(known, lowest, 1) * worst
        away, cost = np.empty_like(place), np.empty(place.shape, np.uint8)
        for k in range(len(planes)):
            np.subtract(place, np.float32(k), out=away)
            away *= slope
            away *= away
            away += floor
            # To whole numbers, 255 at the most: more than any cost of a pixel.
            cv2.convertScaleAbs(away, dst=cost)
            np.minimum(costs[k, band.inner], cost, out=admitted[k, band.inner])

    share(admit, bands(costs.shape[1:]), costs[0].size)
    return admitted
