"""Grey levels and slopes between the pixels, at exact places.

OpenCV's cubic kernel moves a wave of 8 pixels by up to .034 pixels and its table knows 32 places between two
pixels; both are errors of the disparity that no averaging takes away.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]

SECOND = np.array([[5, -54, 299, -500, 299, -54, 5]], np.float32) / np.float32(128)
"""δ² − 3/16 δ⁴ + 5/128 δ⁶: the second difference of Everett's formula and what follows it, as at f = ½."""
FIRST = np.array([[1, -8, 0, 8, -1]], np.float32) / np.float32(12)
"""The slope, right for polynomials to the fourth degree."""
BEND = np.array([[1, -2, 1]], np.float32)
"""δ²."""


class Between:
    """A picture that can be asked between its pixels."""

    def __init__(self, grey: Field) -> None:
        self.grey = grey
        self._across, self._down = _correlate(grey, SECOND), _correlate(grey, SECOND.T)
        slopes = _correlate(grey, FIRST), _correlate(grey, FIRST.T)
        self._plain = np.asarray(cv2.merge(slopes), np.float32)
        self._slopes = [
            np.asarray(cv2.merge([slope, _correlate(slope, BEND), _correlate(slope, BEND.T)]), np.float32)
            for slope in slopes
        ]

    def roughly_at(self, x: Field, y: Field) -> tuple[Field, Field, Field]:
        """Grey level and slopes by plain linear interpolation, for a first step."""
        slope_x, slope_y = (np.asarray(part, np.float32) for part in cv2.split(_linear(self._plain, x, y)))
        return _linear(self.grey, x, y), slope_x, slope_y

    def grey_at(self, x: Field, y: Field) -> Field:
        """Everett's formula, I(x₀ + f) = (1−f) I₀ + f I₁ − f (1−f)/2 [(2−f)/3 δ²₀ + (1+f)/3 δ²₁], along both axes.

        The bracket is δ² interpolated at (1+f)/3. Places that are no numbers give 0.
        """
        left, top = np.floor(x), np.floor(y)
        part_x, part_y = x - left, y - top
        third = np.float32(1 / 3)
        across = _linear(self._across, left + (1 + part_x) * third, y)
        down = _linear(self._down, x, top + (1 + part_y) * third)
        bent = part_x * (1 - part_x) * across + part_y * (1 - part_y) * down
        value = np.asarray(_linear(self.grey, x, y) - np.float32(0.5) * bent, np.float32)
        cv2.patchNaNs(value, 0)
        return value

    def slopes_at(self, x: Field, y: Field) -> tuple[Field, Field]:
        """∂I/∂x and ∂I/∂y, of Everett's formula as far as it is even in f − ½."""
        part_x, part_y = x - np.floor(x), y - np.floor(y)
        share_x, share_y = part_x * (1 - part_x) / 2, part_y * (1 - part_y) / 2
        found = []
        for slopes in self._slopes:
            slope, across, down = cv2.split(_linear(slopes, x, y))
            found.append(np.asarray(slope - share_x * across - share_y * down, np.float32))
            cv2.patchNaNs(found[-1], 0)
        return found[0], found[1]


def _correlate(image: Field, kernel: Field) -> Field:
    return np.asarray(cv2.filter2D(image, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE), np.float32)


def _linear(image: Field, x: Field, y: Field) -> Field:
    return np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
