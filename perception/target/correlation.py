"""A grey-level patch found again by zero-mean normalised cross-correlation, to a fraction of a pixel."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.target.bright import Image, Target

Scores = NDArray[np.float32]


def peak(scores: Scores) -> tuple[float, float, float]:
    """Column, row (sub-pixel) and height of the highest score of a map, height × width.

    The vertex of the paraboloid that fits the peak and its eight neighbours best, which unlike two parabolas,
    one a direction, is right on a slanted ridge too. At the map's rim, where the map is flat, or where the
    vertex leaves the peak's own pixel, the whole pixel is returned.
    """
    _, height, _, (column, row) = cv2.minMaxLoc(scores)
    x, y = float(column), float(row)
    if 0 < column < scores.shape[1] - 1 and 0 < row < scores.shape[0] - 1:
        s = scores[row - 1 : row + 2, column - 1 : column + 2].astype(float)
        across, down = s.sum(0), s.sum(1)
        x_slope, y_slope = (across[2] - across[0]) / 6, (down[2] - down[0]) / 6
        xx, yy = (across[0] - 2 * across[1] + across[2]) / 3, (down[0] - 2 * down[1] + down[2]) / 3
        xy = (s[2, 2] - s[2, 0] - s[0, 2] + s[0, 0]) / 4
        determinant = xx * yy - xy * xy
        if xx < -1e-6 and determinant > 1e-12:
            dx, dy = (xy * y_slope - yy * x_slope) / determinant, (xy * x_slope - xx * y_slope) / determinant
            if max(abs(dx), abs(dy)) <= 1.0:
                x, y = x + dx, y + dy
    return x, y, float(height)


def correlate(image: Image, patch: Image) -> Scores:
    """Zero-mean normalised cross-correlation, −1 to 1, of a patch at every place of an image.

    A place without contrast correlates with nothing: its score is −1, where the quotient would be 0/0.

    Args:
        image: grey, H × W.
        patch: grey, h × w.

    Returns:
        (H − h + 1) × (W − w + 1).
    """
    scores = np.asarray(cv2.matchTemplate(image, patch, cv2.TM_CCOEFF_NORMED), np.float32)
    scores[~np.isfinite(scores) | (scores > 1.001)] = -1.0
    return scores


class PatchTarget:
    """A textured target followed from image to image, and searched for in the whole image once it is lost.

    Args:
        patch: what it looks like, grey, height × width.
        near_px: how far from the expected place it is searched for.
        keep: the least correlation at which it is still the target.
        find: the least at which it is found again after a loss; higher, as a whole image offers more mistakes.

    Raises:
        ValueError: the patch is too small, or has no contrast: it would be found everywhere.
    """

    def __init__(self, patch: Image, *, near_px: int = 24, keep: float = 0.6, find: float = 0.75) -> None:
        if patch.ndim != 2 or min(patch.shape) < 5:
            raise ValueError(
                f"a grey patch of at least 5×5 pixels is needed, this one has shape {patch.shape}"
            )
        if float(patch.std()) < 2.0:
            raise ValueError(
                f"the patch has no texture: standard deviation {patch.std():.1f} grey levels, 2 needed"
            )
        self.patch = patch
        self._near_px, self._keep, self._find = near_px, keep, find
        self._last: tuple[float, float] | None = None

    def detect(self, image: Image, expected_px: tuple[float, float] | None = None) -> Target | None:
        """The target in a grey image, searched for near `expected_px` (or where it was last); None when it is lost."""
        expected = expected_px or self._last
        found = None
        if expected is not None:
            found = self._search(image, self._window(image, expected), self._keep)
        if found is None:
            found = self._search(image, (0, 0, image.shape[1], image.shape[0]), self._find)
        self._last = None if found is None else (found.x_px, found.y_px)
        return found

    def _window(self, image: Image, around: tuple[float, float]) -> tuple[int, int, int, int]:
        height, width = self.patch.shape
        reach_x, reach_y = self._near_px + width / 2, self._near_px + height / 2
        left, top = max(0, math.floor(around[0] - reach_x)), max(0, math.floor(around[1] - reach_y))
        right = min(image.shape[1], math.ceil(around[0] + reach_x) + 1)
        return left, top, right, min(image.shape[0], math.ceil(around[1] + reach_y) + 1)

    def _search(self, image: Image, window: tuple[int, int, int, int], least: float) -> Target | None:
        left, top, right, bottom = window
        height, width = self.patch.shape
        if right - left < width or bottom - top < height:
            return None
        x, y, score = peak(correlate(image[top:bottom, left:right], self.patch))
        if score < least:
            return None
        # The width of the peak is about that of the texture; what is left of it by noise goes with √(1 −
        # score²).
        sigma = 0.05 + 0.5 * math.sqrt(max(0.0, 1 - score * score))
        return Target(
            left + x + (width - 1) / 2, top + y + (height - 1) / 2, float(width * height), score, sigma
        )


@dataclass(frozen=True)
class Disparity:
    """Where the right image shows what is at the left fovea: right − left [px], and the score, −1 to 1."""

    x_px: float
    y_px: float
    confidence: float


def estimate_disparity(
    left: Image,
    right: Image,
    *,
    centre_px: tuple[int, int] | None = None,
    window_px: int = 21,
    reach_px: tuple[int, int] = (16, 3),
    least: float = 0.6,
) -> Disparity | None:
    """Binocular disparity at a fixation: a window of the left image found in the right one.

    None when the window has no texture, correlates less than `least`, or is best matched at the rim of the
    search, where a peak further out cannot be ruled out.

    Args:
        left, right: grey, height × width.
        centre_px: column and row of the window's middle; the image's middle by default.
        window_px: its side.
        reach_px: how far it is searched for, columns and rows.
        least: correlation.

    Raises:
        ValueError: the images differ in size or the window leaves them.
    """
    if left.shape != right.shape or left.ndim != 2:
        raise ValueError(f"two grey images of one size are needed, not {left.shape} and {right.shape}")
    height, width = left.shape
    column, row = centre_px or (width // 2, height // 2)
    half = window_px // 2
    if not (half <= column < width - half and half <= row < height - half):
        raise ValueError(
            f"a window of {window_px} px around {column}, {row} leaves the image of {width}×{height}"
        )
    patch = left[row - half : row + half + 1, column - half : column + half + 1]
    if float(patch.std()) < 2.0:
        return None
    x_low, x_high = max(0, column - half - reach_px[0]), min(width, column + half + reach_px[0] + 1)
    y_low, y_high = max(0, row - half - reach_px[1]), min(height, row + half + reach_px[1] + 1)
    scores = correlate(right[y_low:y_high, x_low:x_high], patch)
    x, y, score = peak(scores)
    if score < least or round(x) in (0, scores.shape[1] - 1):
        return None
    return Disparity(x_low + x + half - column, y_low + y + half - row, score)
