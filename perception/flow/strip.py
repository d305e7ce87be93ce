"""The rows of a window with what lies beside it, filtered once when the image comes."""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.flow.window import Image, Window, check_image

Field = NDArray[np.float32]

DOWN = np.array([0.25, 0.5, 0.25], np.float32)
"""Columns are smoothed lightly: waves along them tell nothing of the horizontal flow."""
DOWN_NOISE = float(np.sum(DOWN**2))
PASS = np.ones(1, np.float32)
MOST_CLIPPED = 1 / 3
"""With more of the window at 0 or 255 its noise is not that of an image, and nothing is believed."""
COARSE_SIGMA = 2.0
COARSE_REACH = 7


def _coarse_taps() -> Field:
    """The second derivative of a Gaussian: it answers neither to a lit gradient nor, much, to vignetting."""
    x = np.arange(-COARSE_REACH, COARSE_REACH + 1) / COARSE_SIGMA
    taps = (x * x - 1) * np.exp(-x * x / 2)
    return np.asarray(taps - taps.mean(), np.float32)


COARSE_TAPS = _coarse_taps()
COARSE_NOISE = float(np.sum(COARSE_TAPS**2)) * float(np.sum(np.convolve(DOWN, DOWN) ** 2))
"""The variance of the coarse image of white noise of variance 1."""


class Strip:
    """One image's window and up to `margin` columns to each side, columns first: (columns, rows), float32.

    first: the image's column that is column 0 here. grey: smoothed along the columns, its mean taken out. coarse:
    second derivative along the row, σ 2 px; power: its sum of squares in every column. clipped: too much of the window
    is black or white.
    """

    __slots__ = ("clipped", "coarse", "columns", "first", "grey", "power")

    def __init__(self, image: Image, window: Window, margin: int) -> None:
        check_image(image, window)
        height, width = image.shape
        left, right = max(window.left - margin, 0), min(window.left + window.width + margin, width)
        above, below = max(window.top - 1, 0), min(window.top + window.height + 1, height)
        rows = slice(window.top - above, window.top - above + window.height)
        crop = cv2.transpose(image[above:below, left:right])
        inner = crop[window.left - left :][: window.width, rows]
        self.clipped = cv2.countNonZero(cv2.inRange(inner, 1, 254)) < (1 - MOST_CLIPPED) * inner.size
        mean = cv2.mean(crop)[0]
        self.first, self.columns = left, right - left
        smooth = cv2.sepFilter2D(crop, cv2.CV_32F, DOWN, PASS, delta=-mean, borderType=cv2.BORDER_REPLICATE)
        self.grey = np.ascontiguousarray(smooth[:, rows], np.float32)
        coarse = cv2.sepFilter2D(self.grey, cv2.CV_32F, DOWN, COARSE_TAPS, borderType=cv2.BORDER_REPLICATE)
        self.coarse = np.asarray(coarse, np.float32)
        self.power = np.einsum("ij,ij->i", self.coarse, self.coarse)
