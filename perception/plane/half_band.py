"""An image of twice the size, so that the linear look-ups of a warp do not pull a motion toward whole pixels.

Between the pixels of the image itself linear interpolation biases a time to contact of 100 frames by 2 to 4 %,
OpenCV's cubic kernel by 9 to 11 %.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]
HALF_BAND = np.array([[-5, 49, -245, 1225, 1225, -245, 49, -5]], np.float32) / np.float32(2048)
"""The value half-way between two pixels: exact for polynomials to the seventh degree."""


def double_size(grey: Field) -> Field:
    """The image (h × w) at half pixels, 2h × 2w; pixel (i, j) is at (2i, 2j), the last row and column repeat."""
    height, width = grey.shape
    wide = np.empty((height, 2 * width), np.float32)
    wide[:, 0::2] = grey
    wide[:, 1::2] = cv2.filter2D(grey, cv2.CV_32F, HALF_BAND, anchor=(3, 0), borderType=cv2.BORDER_REPLICATE)
    double = np.empty((2 * height, 2 * width), np.float32)
    double[0::2] = wide
    double[1::2] = cv2.filter2D(wide, cv2.CV_32F, HALF_BAND.T, anchor=(0, 3), borderType=cv2.BORDER_REPLICATE)
    return double
