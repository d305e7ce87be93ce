"""The forward–backward check: the other image must choose the same plane for the point it was sent."""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.geometry.epipolar import Epipolar
from perception.depth.match.scanline import Volume, cheapest
from perception.image.bands import join_bands, share
from perception.image.plane_warp import find_shift, shift_image, warp_image

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]
THINNING = 2
SPECK = 30
"""Pixels of a patch that is taken for a chance match."""
NO_VIEW = 32_000
"""Cost where a plane of the base view does not reach the other image."""


def backward_planes(total: Volume, geometry: Epipolar, planes: NDArray[np.float64]) -> NDArray[np.int16]:
    """The cheapest plane of every second pixel, both ways, of the *other* image.

    The costs need not be computed again: on each plane the homography gives the base pixel that a
    pixel of the other image meets.
    """
    half, double = np.diag([1 / THINNING, 1 / THINNING, 1.0]), np.diag([THINNING, THINNING, 1.0])
    backward = np.linalg.inv(half @ geometry.homographies(planes) @ double)
    thin = total[:, ::THINNING, ::THINNING]
    count, height, width = thin.shape
    seen = np.empty(thin.shape, np.int16)

    def turn(k: int) -> None:
        image, shift = np.ascontiguousarray(thin[k]), find_shift(backward[k])
        if shift is None:
            seen[k] = warp_image(image, backward[k], cv2.INTER_NEAREST, NO_VIEW)
        else:
            seen[k] = shift_image(image, round(shift[0]), round(shift[1]), NO_VIEW)

    share(turn, range(count), height * width)
    (best,) = join_bands((height, width), lambda band: (cheapest(seen[:, band.inner]),))
    return best


def agree(
    plane: NDArray[np.int16], backward: NDArray[np.int16], x: Field, y: Field, tolerance: int = 1
) -> Mask:
    """Which base pixels the other image confirms.

    Args:
        plane: the plane chosen in the base view; x, y: where that puts each pixel.
        backward: the planes chosen in the other view, as `backward_planes` gives them.
        tolerance: how many planes the two may differ.

    Returns:
        confirmed, height × width.
    """
    # Nothing within the tolerance of any plane.
    outside = -1 - tolerance
    there = cv2.remap(
        backward,
        x / THINNING,
        y / THINNING,
        cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(outside,),
    )
    return np.asarray(np.abs(there - plane) <= tolerance)


def without_specks(confirmed: Mask, place: NDArray[np.float32]) -> Mask:
    """The confirmed pixels without those of small patches that differ from their surroundings.

    Windows and aggregation make neighbours agree, so a surface is confirmed over more than `SPECK` connected pixels
    that differ by less than a plane; a smaller patch is a chance match.

    Args:
        confirmed: by `agree`, height × width.
        place: the chosen place between the planes.
    """
    # In sixteenths of a plane, as the function takes them; 0 is what was not confirmed.
    coded = np.where(confirmed, place * 16 + 1, 0).astype(np.int16)
    cv2.filterSpeckles(coded, 0, SPECK, 16)
    return coded > 0
