"""Matched filters: a low-pass p and a derivative d whose spectra agree, D(ω) = iω P(ω).

Derivatives along x, y and t that are taken with d along one axis and p along the others are then those of one and the
same smoothed image, where a Sobel or Scharr mask against a difference of two frames is not. The taps are those of Farid
and Simoncelli, Differentiation of discrete multidimensional signals, IEEE Trans. Image Processing 13 (2004): the five
agree to 3 % up to ω = 2 (waves of 3 samples), the seven to .2 %.

To correlate with, as OpenCV does: a ramp that rises gives a positive derivative.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Taps = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Matched:
    """Low-pass p and derivative d of one length."""

    level: Taps
    slope: Taps

    @property
    def level_power(self) -> float:
        """Σ p², what the low-pass leaves of the variance of white noise."""
        return float(np.sum(self.level**2))

    @property
    def slope_power(self) -> float:
        """Σ d²."""
        return float(np.sum(self.slope**2))


def _mirrored(level: tuple[float, ...], slope: tuple[float, ...]) -> Matched:
    """From the taps right of the middle; the low-pass has its middle first."""
    side = np.array(level[1:])
    right = np.array(slope)
    return Matched(
        np.concatenate((side[::-1], level[:1], side)).astype(np.float32),
        np.concatenate((-right[::-1], [0.0], right)).astype(np.float32),
    )


FIVE = _mirrored((0.439911, 0.249724, 0.030320), (0.292315, 0.104550))
SEVEN = _mirrored((0.361117, 0.245410, 0.069321, 0.004711), (0.193091, 0.125376, 0.018708))
