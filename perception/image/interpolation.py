"""Grey levels and slopes between the pixels, at exact places.

OpenCV's cubic kernel moves a wave of 8 pixels by up to .034 pixels and its table has 32 places between two
pixels; both are errors of the disparity that no averaging takes away. Its linear look-ups are exact since version 5.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]

SECOND = np.array([[5, -54, 299, -500, 299, -54, 5]], np.float32) / np.float32(128)
"""δ² − 3/16 δ⁴ + 5/128 δ⁶: the second difference of Everett's formula and what follows it, as at f = ½."""
FIRST = np.array([[-2, 13, -50, 0, 50, -13, 2]], np.float32) / np.float32(60)
"""The slope, right for polynomials to the fourth degree and within 3 % for waves of 4 pixels and more."""


class InterpolatedImage:
    """An image with grey levels and slopes between its pixels."""

    def __init__(self, grey: Field) -> None:
        self._across, self._down = _correlate(grey, SECOND), _correlate(grey, SECOND.T)
        slope_x, slope_y = _correlate(grey, FIRST), _correlate(grey, FIRST.T)
        # OpenCV looks up four channels in the time of one and half that of three.
        self._with_x, self._with_y = (
            np.asarray(
                cv2.merge((grey, slope, _correlate(slope, SECOND), _correlate(slope, SECOND.T))), np.float32
            )
            for slope in (slope_x, slope_y)
        )

    def at(self, x: Field, y: Field) -> tuple[Field, Field, Field]:
        """Grey level and slopes ∂I/∂x and ∂I/∂y at some places; 0 where a place is no number.

        Everett's formula along both axes, I(x₀ + f) = (1−f) I₀ + f I₁ − f (1−f)/2 [(2−f)/3 δ²₀ + (1+f)/3 δ²₁].
        The bracket is δ² interpolated at (1+f)/3; for the slopes, that move no match, at f.

        Args:
            x, y: columns and rows, pixels, arrays of one shape.
        """
        left, top = np.floor(x), np.floor(y)
        part_x, part_y = x - left, y - top
        third, half = np.float32(1 / 3), np.float32(0.5)
        share_x, share_y = half * part_x * (1 - part_x), half * part_y * (1 - part_y)
        value, plain_x, across_x, down_x = cv2.split(_linear(self._with_x, x, y))
        _, plain_y, across_y, down_y = cv2.split(_linear(self._with_y, x, y))
        across = _linear(self._across, left + (1 + part_x) * third, y)
        down = _linear(self._down, x, top + (1 + part_y) * third)
        grey = np.asarray(value - share_x * across - share_y * down, np.float32)
        slope_x = np.asarray(plain_x - share_x * across_x - share_y * down_x, np.float32)
        slope_y = np.asarray(plain_y - share_x * across_y - share_y * down_y, np.float32)
        for part in (grey, slope_x, slope_y):
            cv2.patchNaNs(part, 0)
        return grey, slope_x, slope_y


def _correlate(image: Field, kernel: Field) -> Field:
    return np.asarray(cv2.filter2D(image, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE), np.float32)


def _linear(image: Field, x: Field, y: Field) -> Field:
    return np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
