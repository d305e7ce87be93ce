"""The extended sum of squared differences around a predicted match, thesis (2.6)–(2.8).

Every pixel of the base image is sent to the other one by its own inverse depth, so that the window
follows a slanted surface; the error surface is then expanded around that place along the epipolar line
(u) and across it (v).
"""

from enum import Enum

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.geometry.epipolar import Projection
from perception.depth.match.contrast import ROUNDING
from perception.depth.refine.parabola import Quadric
from perception.depth.settings import Equalisation
from perception.image.interpolation import InterpolatedImage

Field = NDArray[np.float32]
LEAST_POWER = 1e-3
"""No window has less contrast than this, grey levels squared."""
SLOPE_NOISE = 0.76
"""Variance of the noise in a slope for one of the noise in a softened image, white before it was softened."""
TEXTURE_GATE = 0.01
"""Least ratio of standard deviation to mean for (2.8) to be used, thesis section 2.9.1."""


class Window(Enum):
    """The weights φ of (2.6)."""

    FLAT = "flat"
    """1 over the square, as in the thesis."""
    TENT = "tent"
    """Falling linearly to the rim; a flat window responds to some wave lengths with the wrong sign."""


class BaseWindow:
    """The windows of the base image, whose moments all candidates share."""

    def __init__(self, grey: Field, radius: int, window: Window = Window.FLAT) -> None:
        self.grey = grey
        offsets = np.abs(np.arange(-radius, radius + 1))
        profile = np.ones(2 * radius + 1) if window is Window.FLAT else radius + 1.0 - offsets
        self._profile = (profile / profile.sum()).astype(np.float32)
        self.pixels = round(1 / float(np.sum(self._profile**2)) ** 2)
        """N: the pixels of the flat window that averages noise as well."""
        self.mean = self.average(grey)
        self.variance = np.maximum(self.average(grey * grey) - self.mean * self.mean, 0)

    def average(self, image: Field) -> Field:
        """Σ φ image/N over the window of every pixel."""
        return np.asarray(
            cv2.sepFilter2D(image, -1, self._profile, self._profile, borderType=cv2.BORDER_REFLECT_101),
            np.float32,
        )

    def sum_of_squares(self, warped: Field, equalisation: Equalisation) -> Field:
        """Σ φ [I_t − equalised I_{t+τ}]² over the window, Σ φ = N; height × width, grey levels squared."""
        if equalisation is Equalisation.NONE:
            difference = self.grey - warped
            return self.average(difference * difference) * np.float32(self.pixels)
        mean = self.average(warped)
        gate = np.sqrt(self.variance) > TEXTURE_GATE * np.maximum(self.mean, 1e-3)
        ratio = np.where(gate & (mean > 1e-3), self.mean / np.maximum(mean, 1e-3), np.float32(1))
        square = self.average(self.grey * self.grey)
        cross = self.average(self.grey * warped)
        power = self.average(warped * warped)
        return np.maximum(square - 2 * ratio * cross + ratio * ratio * power, 0) * np.float32(self.pixels)


def sample_surface(base: BaseWindow, other: InterpolatedImage, projection: Projection) -> Quadric:
    """The error surface around where `projection` sends every pixel, as a quadric in (u, v) pixels.

    It is q(u, v) = Σ φ [I − a (J + u J_u + v J_v) − b]², J the warped image and J_u, J_v its slopes along and
    across the line. Mean and contrast, b and a, are fitted along with the place, and so taken out of every product.
    Differences of q between displaced windows would give the same curvatures, but their slope is false by
    what moves in and out of the window: h² Σ φ J_u J_uu for samples h apart, some hundredths of a pixel.

    Args:
        base: the windows of the base image, height × width.
        other: the other image.
        projection: the predicted place of every pixel.

    Returns:
        The quadric in grey levels squared and pixels.
    """
    along_x, along_y, _ = projection.line
    warped, slope_x, slope_y = other.at(projection.x, projection.y)
    u, v = slope_x * along_x + slope_y * along_y, slope_y * along_x - slope_x * along_y
    mean, mean_u, mean_v = base.average(warped), base.average(u), base.average(v)
    power = np.maximum(base.average(warped * warped) - mean * mean, np.float32(LEAST_POWER))
    common = base.average(base.grey * warped) - base.mean * mean
    gain = common / power
    # What of the slopes a change of contrast could explain as well.
    like_u = (base.average(u * warped) - mean_u * mean) / power
    like_v = (base.average(v * warped) - mean_v * mean) / power
    uu = base.average(u * u) - mean_u * mean_u - like_u * like_u * power
    vv = base.average(v * v) - mean_v * mean_v - like_v * like_v * power
    uv = base.average(u * v) - mean_u * mean_v - like_u * like_v * power
    pull_u = base.average(u * base.grey) - mean_u * base.mean - like_u * common
    pull_v = base.average(v * base.grey) - mean_v * base.mean - like_v * common
    least = np.maximum(base.variance - gain * common, np.float32(0))
    # The noise in the slopes is no texture; with it, an edge along the line would seem to determine a place on it.
    noise = np.float32(SLOPE_NOISE) * least / (1 + gain * gain)
    uu = np.maximum(uu - noise, uv * uv / np.maximum(vv, np.float32(1e-6)))
    vv = np.maximum(vv - noise, uv * uv / np.maximum(uu, np.float32(1e-6)))
    scale = np.float32(2 * base.pixels) * np.maximum(gain, np.float32(0))
    least = least * np.float32(base.pixels)
    parts = (-scale * pull_u, -scale * pull_v, scale * gain * uu, scale * gain * uv, scale * gain * vv)
    return Quadric(least, *(np.asarray(part, np.float32) for part in parts))


def noise_power(least: Field, window: BaseWindow) -> Field:
    """s² = q_min/(N − 1), and never less than the rounding of grey levels makes."""
    return np.asarray(np.maximum(least / np.float32(window.pixels - 1), np.float32(ROUNDING)), np.float32)
