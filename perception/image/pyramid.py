"""The Gaussian pyramid of the coarse-to-fine search, thesis section 2.5."""

import cv2
import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]


def build_pyramid(grey: Field, levels: int) -> list[Field]:
    """The image and its halvings, finest first; no level is made smaller than 16 pixels."""
    pyramid = [grey]
    while len(pyramid) < levels and min(pyramid[-1].shape) >= 32:
        height, width = pyramid[-1].shape
        blurred = cv2.GaussianBlur(pyramid[-1], (0, 0), 1.0)
        pyramid.append(
            np.asarray(
                cv2.resize(blurred, (width // 2, height // 2), interpolation=cv2.INTER_LINEAR), np.float32
            )
        )
    return pyramid


def enlarge(field: Field, shape: tuple[int, int]) -> Field:
    """A map of a coarse level brought to a finer one; the values are not scaled."""
    return np.asarray(cv2.resize(field, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), np.float32)
