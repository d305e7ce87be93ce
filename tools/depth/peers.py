"""OpenCV's matchers with the parameters of the comparison, and the score of Middlebury."""

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Field = NDArray[np.float32]


def match_sgbm(left: Image, right: Image, most: int) -> Field:
    """StereoSGBM 3-way: block 5, P1 200, P2 800, uniqueness 10, speckle 100/2; px, NaN where it gives nothing."""
    matcher = cv2.StereoSGBM.create(0, most, 5, 200, 800, 1, 0, 10, 100, 2, cv2.STEREO_SGBM_MODE_SGBM_3WAY)
    return _in_pixels(np.asarray(matcher.compute(left, right)))


def match_bm(left: Image, right: Image, most: int) -> Field:
    """StereoBM: block 15, uniqueness 10, speckle 100/2; px, NaN where it gives nothing."""
    matcher = cv2.StereoBM.create(most, 15)
    matcher.setUniquenessRatio(10)
    matcher.setSpeckleWindowSize(100)
    matcher.setSpeckleRange(2)
    return _in_pixels(np.asarray(matcher.compute(left, right)))


def _in_pixels(fixed: NDArray[np.integer]) -> Field:
    disparity = fixed.astype(np.float32) / np.float32(16)
    return np.where(disparity < 0, np.float32(np.nan), disparity)


def fill_from_left(disparity: Field) -> Field:
    """Each hole takes the last value to its left, one that has none the first to its right; in an empty row, 0."""
    known = np.isfinite(disparity)
    columns = np.where(known, np.arange(disparity.shape[1])[None, :], -1)
    place = np.maximum.accumulate(columns, axis=1)
    place = np.where(place < 0, np.argmax(known, axis=1)[:, None], place)
    return np.nan_to_num(np.take_along_axis(disparity, place, axis=1), nan=0.0)


def bad_percent(disparity: Field, truth: Field, threshold: float) -> float:
    """Per cent of the pixels with truth whose disparity errs by more than `threshold` px; a hole is an error."""
    there = np.isfinite(truth)
    good = np.abs(disparity[there] - truth[there]) <= threshold
    return float(100 * np.mean(~good))
