"""The second image of a pair, warped onto the window of the first."""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.plane.half_band import double_size
from perception.plane.template import PIXEL_VARIANCE, SOFTNESS_PX, soften
from perception.plane.window import Window

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]
CORNERS = np.array([[-1, -1, 1], [-1, 1, 1], [1, -1, 1], [1, 1, 1.0]])
MARGIN = 8
"""Pixels around the window's place that are made ready: how far the homography may still change."""
DOUBLE = np.diag([2.0, 2.0, 1.0])


class SecondImage:
    """The part of an image where a window is seen, softened as its scale asks and of twice the size."""

    def __init__(self, image: Field, window: Window, homography: Matrix) -> None:
        """homography: about where the window's pixels are in this image."""
        self.window = window
        corners = CORNERS @ (homography @ window.to_pixels).T
        self.hidden = bool(corners[:, 2].min() <= 0)
        """Whether nothing of the window is seen."""
        if self.hidden:
            return
        # Near the window only: the rest of the image is not looked at.
        places = corners[:, :2] / corners[:, 2:]
        left, top = (max(int(place) - MARGIN, 0) for place in places.min(axis=0))
        right, bottom = (max(int(place) + MARGIN + 2, 0) for place in places.max(axis=0))
        part = image[top:bottom, left:right]
        self.hidden = min(part.shape) < 2 * MARGIN
        if not self.hidden:
            self._double = double_size(soften(part, _matching_softness(homography, window.to_pixels)))
            self._from_pixels = DOUBLE @ np.array([[1.0, 0, -left], [0, 1, -top], [0, 0, 1]])
            self._corner = np.array([[1.0, 0, window.left], [0, 1, window.top], [0, 0, 1]])

    def warped(self, homography: Matrix) -> Field:
        """What the window's pixels show under a homography, height × width of the window; NaN where the image ends."""
        window = self.window
        warped = cv2.warpPerspective(
            self._double,
            self._from_pixels @ homography @ self._corner,
            (window.width, window.height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(np.nan,) * 4,
        )
        return np.asarray(warped, np.float32)


def _matching_softness(homography: Matrix, frame: Matrix) -> float:
    """How soft the second image must be to show, at its own scale, what the template shows at its."""
    (a, b, c), (d, e, f), (g, h, i) = homography.tolist()
    depth = g * frame[0, 2] + h * frame[1, 2] + i
    # By how much areas grow in the middle of the window.
    growth = abs(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) / depth**3
    return float(np.sqrt(max(growth * (SOFTNESS_PX**2 + PIXEL_VARIANCE) - PIXEL_VARIANCE, 0.1)))
