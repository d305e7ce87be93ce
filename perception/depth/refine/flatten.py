"""The steps between planes smoothed, the discontinuities between surfaces left."""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.image.bands import join_bands

Field = NDArray[np.float32]
FLAT_RADIUS = 4
"""Half the window, in pixels, over which the steps between planes are smoothed."""


def flatten_steps(disparity: Field, radius: int = FLAT_RADIUS, step: float = 0.5) -> Field:
    """Smooth the steps between planes and leave the discontinuities between surfaces.

    Over the window the mean replaces the value as far as the window's variance is below that of a `step`;
    both are averaged over all windows that hold the pixel (He's guided filter with itself as guide).
    """
    side = (2 * radius + 1, 2 * radius + 1)
    mean = cv2.blur(disparity, side)
    variance = np.maximum(cv2.blur(disparity * disparity, side) - mean * mean, 0)
    power = variance * variance
    keep = power / (power + np.float32(step**4))
    return np.asarray(cv2.blur(keep, side) * disparity + cv2.blur((1 - keep) * mean, side), np.float32)


def flatten_whole(disparity: Field) -> Field:
    """`flatten_steps` of a whole map, in bands."""
    shape = disparity.shape[0], disparity.shape[1]
    (flat,) = join_bands(
        shape, lambda band: (flatten_steps(disparity[band.outer])[band.trim],), 2 * FLAT_RADIUS
    )
    return flat
