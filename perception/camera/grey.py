"""Images in grey, whatever OpenCV delivers."""

from typing import Any

import cv2
import numpy as np

from perception.camera.frame import Image


def as_grey(image: Any) -> Image:
    """The grey image (height, width) of one that is grey, (height, width, 1), or BGR, (height, width, 3)."""
    grey = np.asarray(image, np.uint8)
    if grey.ndim == 3:
        grey = np.asarray(
            grey[:, :, 0] if grey.shape[2] == 1 else cv2.cvtColor(grey, cv2.COLOR_BGR2GRAY), np.uint8
        )
    return grey
