"""An image seen through the homography of a plane."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
AnyImage = NDArray[Any]
STILL = 1e-9
"""A homography that differs less from a shift is one."""
WHOLE_PX = 1 / 512
"""A shift this close to whole pixels is one of whole pixels: bytes show no less."""


def find_shift(homography: Matrix) -> tuple[float, float] | None:
    """By how much the homography only shifts, x and y in pixels; None when it does anything else.

    K (R + ρ t e₃ᵀ) K⁻¹ is a shift for all planes of a camera that neither turns nor moves forward. Shifting takes a
    fifth of the time of a warp.
    """
    even = homography / homography[2, 2]
    x, y = float(even[0, 2]), float(even[1, 2])
    even[:2, 2] = 0
    return (x, y) if np.abs(even - np.eye(3)).max() < STILL else None


def shift_image(image: AnyImage, x: float, y: float, outside: int) -> AnyImage:
    """The image at (column + x, row + y), linear between pixels; `outside` where it ends.

    Args:
        image: one channel, height × width.
        x, y: pixels.
    """
    place, source, parts = [], [], []
    for size, shift in zip(image.shape, (y, x), strict=True):
        whole = int(np.floor(shift + WHOLE_PX))
        part = shift - whole if shift - whole > WHOLE_PX else 0.0
        between = int(part > 0)
        # One line of `outside` is on both sides.
        first, last = max(0, -whole - 1), min(size, size + 1 - whole - between)
        if first >= last:
            return np.full_like(image, outside)
        place.append(slice(first, last))
        source.append(slice(first + whole + 1, last + whole + between + 1))
        parts.append(part)
    seen = cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(outside,))[tuple(source)]
    if parts[0]:
        seen = cv2.addWeighted(seen[:-1], 1 - parts[0], seen[1:], parts[0], 0)
    if parts[1]:
        seen = cv2.addWeighted(seen[:, :-1], 1 - parts[1], seen[:, 1:], parts[1], 0)
    shifted = np.full_like(image, outside)
    shifted[tuple(place)] = seen
    return shifted


def warp_image(image: AnyImage, homography: Matrix, interpolation: int, outside: int) -> AnyImage:
    """The image seen through a homography from the result's pixels to the image's; `outside` where it ends."""
    return np.asarray(
        cv2.warpPerspective(
            image,
            homography,
            (image.shape[1], image.shape[0]),
            flags=interpolation | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(outside,) * 4,
        )
    )
