"""The flow of a window as chapter 3 of the thesis computes it, to the letter: the preset `thesis`.

Five images in a row are smoothed in time, causally and recursively (3.7), and then by a Gaussian. The last two give
I_t = I_s(t) − I_s(t−1), and u = −I_t/I_x (3.6); the window's flow is the mean of u over the pixels whose |I_x|
suffices. Then five new images are taken, and the filter starts anew with I_s(0) = I(0). After five images a flow is
therefore scaled by 1 − λ⁴: .87 at λ = .6. It stays so here.

The thesis prints neither λ nor σ nor the threshold, nor which of the two images gives I_x: they are choices. (3.5)
lacks the minus sign of (3.4) and (3.6); it is not used.
"""

from dataclasses import dataclass
from math import nan

import cv2
import numpy as np

from perception.flow.errors import SettingError
from perception.flow.window import Image, Window, check_image

IMAGES = 5
CENTRAL = np.array([-0.5, 0.0, 0.5], np.float32)
PASS = np.ones(1, np.float32)


@dataclass(frozen=True, slots=True)
class ThesisSettings:
    """λ of (3.7), σ of the Gaussian in px, least |I_x| in grey levels a pixel."""

    smoothing: float = 0.6
    sigma_px: float = 1.0
    least_slope: float = 4.0

    def __post_init__(self) -> None:
        if not 0 <= self.smoothing < 1:
            raise SettingError(f"smoothing λ is {self.smoothing}: it must be at least 0 and below 1")
        if not 0 < self.sigma_px <= 5:
            raise SettingError(f"sigma is {self.sigma_px} px: it must be above 0 and at most 5")
        if not self.least_slope > 0:
            raise SettingError(
                f"least slope is {self.least_slope}: it must be above 0, or flat pixels divide 0 by 0"
            )


THESIS = ThesisSettings()


@dataclass(frozen=True, slots=True)
class MeanFlow:
    """Mean of u over the window, px a frame, positive to the right, NaN without vectors; and how many there were."""

    flow_px: float
    vectors: int


class ThesisFlow:
    """Takes images one by one; every fifth gives a flow."""

    def __init__(self, window: Window, settings: ThesisSettings = THESIS) -> None:
        self.window = window
        self.settings = settings
        self._smoothed: list[cv2.typing.MatLike] = []
        self._taken = 0

    def step(self, image: Image) -> MeanFlow | None:
        """The mean flow of a set of five images when its last one comes, else None; raises ImageError."""
        check_image(image, self.window)
        crop, inner = self._crop(image)
        new = crop.astype(np.float32)
        keep = self.settings.smoothing
        now = new if not self._smoothed else cv2.addWeighted(self._smoothed[-1], keep, new, 1 - keep, 0)
        self._smoothed = [*self._smoothed[-1:], now]
        self._taken += 1
        if self._taken < IMAGES:
            return None
        before, last = (cv2.GaussianBlur(i, (0, 0), self.settings.sigma_px) for i in self._smoothed)
        self._smoothed, self._taken = [], 0
        along_x = cv2.sepFilter2D(last, cv2.CV_32F, CENTRAL, PASS)[inner]
        along_t = (last - before)[inner]
        strong = np.abs(along_x) > self.settings.least_slope
        count = int(np.count_nonzero(strong))
        flow = float(np.mean(-along_t[strong] / along_x[strong])) if count else nan
        return MeanFlow(flow, count)

    def _crop(self, image: Image) -> tuple[Image, tuple[slice, slice]]:
        """The window with what its filters reach over, and where the window is in it."""
        window, reach = self.window, int(np.ceil(4 * self.settings.sigma_px)) + 1
        left, top = max(window.left - reach, 0), max(window.top - reach, 0)
        crop = image[top : window.top + window.height + reach, left : window.left + window.width + reach]
        row, column = window.top - top, window.left - left
        return crop, (slice(row, row + window.height), slice(column, column + window.width))
