"""Grey-level differences with mean and contrast of the window taken out.

The thesis equalises the mean of the window by a ratio (2.8). A ratio removes a gain but no offset, so
the search for the match works on gradients, which have no mean, divided by the contrast of their
surroundings and limited: what remains is little more than the sign of the slope, and that survives
gain, offset, vignetting and an occluding edge.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.image.bands import Band, join_bands
from perception.image.quantile import median

Grey = NDArray[np.float32]
Bytes = NDArray[np.uint8]

SLOPE_GAIN = 12.0**0.5
"""Standard deviation of a 3×3 Sobel slope for white noise of standard deviation one."""
CONTRAST_RADIUS = 10
"""Half the window, in pixels, over which the contrast is measured."""
LIMIT = 0.3
"""Slopes beyond this part of the local contrast all look alike."""
NOISE_LIMIT = 2.0
"""… and so do slopes beyond this many standard deviations of the noise."""

NOISY_SHARE = 0.3
"""An image is noisy when the noise makes this part of its slopes or more."""
NOISE_LEFT = 0.75
"""What `denoise` leaves of it where the texture is: a third on even ground, all of it on an edge."""
SOFTENING = np.array([0.25, 0.5, 0.25], np.float32)
SOFTENED_NOISE = float(np.sum(SOFTENING**2)) ** 2
"""The part of the noise's variance that a pixel of the softened image keeps."""
ROUNDING = SOFTENED_NOISE / 12
"""Grey levels squared: what rounding to whole levels leaves as difference of two softened images."""


def estimate_noise(grey: Grey) -> float:
    """Standard deviation of the pixel noise in grey levels, from second differences both ways.

    The mask [1 −2 1]ᵀ[1 −2 1] responds neither to slopes nor to straight edges along the axes; its
    median is little moved by the texture that is left. At least the .3 levels of quantisation.
    """
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    response = np.abs(cv2.filter2D(grey, cv2.CV_32F, mask))[::2, ::2]
    return max(median(response) / (6 * 0.6745), 0.3)


def window_mean(image: Grey, radius: int) -> Grey:
    """Mean over the window of (2·radius + 1)² pixels."""
    side = 2 * radius + 1
    return np.asarray(cv2.blur(image, (side, side), borderType=cv2.BORDER_REFLECT_101), np.float32)


def equalised_slopes(grey: Grey, noise: float) -> Bytes:
    """The two slopes of the image in units of the local contrast, limited to ±1 and coded as 0…254.

    Args:
        grey: height × width, grey levels.
        noise: standard deviation of the pixel noise in grey levels.

    Returns:
        2 × height × width: slope along x and along y.
    """
    floor = (NOISE_LIMIT * SLOPE_GAIN * noise) ** 2

    def code(band: Band) -> tuple[Bytes, ...]:
        across = cv2.Sobel(grey[band.outer], cv2.CV_32F, 1, 0)
        down = cv2.Sobel(grey[band.outer], cv2.CV_32F, 0, 1)
        power = window_mean(np.asarray(across * across + down * down, np.float32), CONTRAST_RADIUS)
        scale = np.float32(127) / np.sqrt(np.float32(LIMIT**2 / 2) * power + np.float32(floor))
        half = np.full_like(scale, 127)
        return tuple(
            np.asarray(cv2.add(slope * scale, half, dtype=cv2.CV_8U)[band.trim], np.uint8)
            for slope in (across, down)
        )

    return np.stack(join_bands((grey.shape[0], grey.shape[1]), code, CONTRAST_RADIUS + 1))


def noise_share(grey: Grey, noise: float) -> float:
    """The slope that the noise makes as a part of the image's root mean square slope along the rows."""
    slope = cv2.Sobel(grey, cv2.CV_32F, 1, 0)
    texture = float(np.sqrt(np.mean(slope * slope)))
    return SLOPE_GAIN * noise / max(texture, 1e-6)


def denoise(grey: Grey, noise: float) -> Grey:
    """Take out the noise and leave the edges: Wiener's filter with the statistics of windows of 3×3 (Lee).

    Of a window with mean m and variance v the part a = s/(s + σ²), s = max(v − σ², 0), is signal, and the window
    estimates a·g + (1 − a)·m; a pixel takes the mean of its nine windows' estimates. An edge exceeds the noise and
    is not widened, as it is by a blur that takes as much noise. But the filter is not linear, and tenths of a pixel
    cannot be measured in its image.
    """
    mean = window_mean(grey, 1)
    variance = window_mean(np.asarray(grey * grey, np.float32), 1) - mean * mean
    power = np.float32(noise * noise)
    signal = np.maximum(variance - power, 0)
    part = np.asarray(signal / (signal + power), np.float32)
    rest = np.asarray((1 - part) * mean, np.float32)
    return np.asarray(window_mean(part, 1) * grey + window_mean(rest, 1), np.float32)


def soften(grey: Grey, more: float = 1.0) -> Grey:
    """Take out the waves of less than four pixels, which no interpolation puts in the right place.

    Args:
        more: how many times the variance of the usual mask, ½ px², is wanted: .6 to 1.6.
    """
    side = SOFTENING[0] * np.float32(more)
    mask = np.array([side, 1 - 2 * side, side], np.float32)
    return np.asarray(cv2.sepFilter2D(grey, cv2.CV_32F, mask, mask), np.float32)


def noise_weight(soft: Grey) -> float:
    """By how much noise moves a match more than its variance in the softened image suggests.

    Softened noise no longer differs from pixel to pixel. What Σ φ g n sees of it is h ∗ g in the place of g, so
    that its variance is Σ (h ∗ g)²/Σ g² of that of the noise before, which is Σ h² times smaller now.
    """
    slope = np.diff(soft, axis=1)
    seen = float(np.mean(np.square(soften(slope)))) / max(float(np.mean(np.square(slope))), 1e-9)
    return max(seen, SOFTENED_NOISE) / SOFTENED_NOISE
