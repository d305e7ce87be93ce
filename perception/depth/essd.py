"""The extended sum of squared differences around a predicted match, thesis (2.6)–(2.8).

Every pixel of the base picture is sent to the other one by its own inverse depth, so that the window
follows a slanted surface; the error surface is then sampled around that place along the epipolar line
(u) and across it (v).
"""

from enum import Enum

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.epipolar import Projection
from perception.depth.parabola import Quadric, fit_quadric
from perception.depth.select import select

Field = NDArray[np.float32]
STENCIL = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1))


class Equalisation(Enum):
    """What is taken out of the window before grey levels are compared."""

    NONE = "none"
    """(2.6), (2.7): nothing."""
    MEAN_RATIO = "mean-ratio"
    """(2.8): the ratio of the means, where the window has texture. Removes a gain, not an offset."""
    NORMALISED = "normalised"
    """Difference of means and ratio of standard deviations: removes gain and offset."""


TEXTURE_GATE = 0.01
"""Least ratio of standard deviation to mean for (2.8) to be used, thesis section 2.9.1."""


class Window(Enum):
    """The weights φ of (2.6)."""

    FLAT = "flat"
    """1 over the square, as in the thesis."""
    TENT = "tent"
    """Falling linearly to the rim; a flat window answers some wave lengths with the wrong sign."""


class BaseWindow:
    """The windows of the base picture, whose moments all candidates share."""

    def __init__(
        self, grey: Field, radius: int, equalisation: Equalisation, window: Window = Window.FLAT
    ) -> None:
        self.grey = grey
        self.equalisation = equalisation
        offsets = np.abs(np.arange(-radius, radius + 1))
        profile = np.ones(2 * radius + 1) if window is Window.FLAT else radius + 1.0 - offsets
        self._profile = (profile / profile.sum()).astype(np.float32)
        self.pixels = round(1 / float(np.sum(self._profile**2)) ** 2)
        """N: the pixels of the flat window that averages noise as well."""
        self.mean = self._average(grey)
        self.variance = np.maximum(self._average(grey * grey) - self.mean * self.mean, 0)

    def _average(self, image: Field) -> Field:
        return np.asarray(
            cv2.sepFilter2D(image, -1, self._profile, self._profile, borderType=cv2.BORDER_REFLECT_101),
            np.float32,
        )

    def sum_of_squares(self, warped: Field) -> Field:
        """Σ φ [I_t − equalised I_{t+τ}]² over the window, Σ φ = N; height × width, grey levels squared."""
        if self.equalisation is Equalisation.NONE:
            difference = self.grey - warped
            return self._average(difference * difference) * np.float32(self.pixels)
        mean = self._average(warped)
        if self.equalisation is Equalisation.MEAN_RATIO:
            gate = np.sqrt(self.variance) > TEXTURE_GATE * np.maximum(self.mean, 1e-3)
            ratio = np.where(gate & (mean > 1e-3), self.mean / np.maximum(mean, 1e-3), np.float32(1))
            square = self._average(self.grey * self.grey)
            cross = self._average(self.grey * warped)
            power = self._average(warped * warped)
            return np.maximum(square - 2 * ratio * cross + ratio * ratio * power, 0) * np.float32(self.pixels)
        # As 2 N (σ² − σ/σ' cov), step by step in place, for this is asked seven times a pixel.
        product = warped * warped
        variance = self._average(product)
        variance -= np.multiply(mean, mean, out=product)
        np.maximum(variance, np.float32(1e-6), out=variance)
        covariance = self._average(np.multiply(self.grey, warped, out=product))
        mean *= self.mean
        covariance -= mean
        np.divide(self.variance, variance, out=variance)
        covariance *= np.sqrt(variance, out=variance)
        np.subtract(self.variance, covariance, out=covariance)
        np.maximum(covariance, np.float32(0), out=covariance)
        covariance *= np.float32(2 * self.pixels)
        return covariance


def epipolar_axes(projection: Projection) -> tuple[Field, Field, Field]:
    """Unit vector along the epipolar line (ex, ey) and |C|, the pixels a unit of inverse depth is worth."""
    length = np.sqrt(np.square(projection.slope_x) + np.square(projection.slope_y))
    safe = np.maximum(length, np.float32(1e-9))
    away = length > 1e-9
    return select(away, projection.slope_x / safe, 1), select(away, projection.slope_y / safe, 0), length


def sample_surface(base: BaseWindow, other: Field, projection: Projection, step: float) -> Quadric:
    """The error surface around where `projection` sends every pixel, as a quadric in (u, v) pixels.

    Args:
        base: the windows of the base picture.
        other: the other picture, grey levels.
        projection: the predicted place of every pixel.
        step: distance of the samples in pixels.
    """
    along_x, along_y, _ = epipolar_axes(projection)
    along_x, along_y = along_x * np.float32(step), along_y * np.float32(step)
    values = {}
    for i, j in STENCIL:
        warped = cv2.remap(
            other,
            _away(_away(projection.x, i, along_x), -j, along_y),
            _away(_away(projection.y, i, along_y), j, along_x),
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        )
        values[i, j] = base.sum_of_squares(np.asarray(warped, np.float32))
    return fit_quadric(values, step)


def _away(place: Field, sign: int, step: Field) -> Field:
    """place + sign · step for a sign of −1, 0 or 1."""
    return place if sign == 0 else place + step if sign > 0 else place - step
