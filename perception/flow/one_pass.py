"""The flow of a window from five frames in one pass, without warping: shifts up to 3 px a frame.

Derivatives are taken with matched filters along x, y and t (derivatives.py), so I_t = −u I_x holds for every wave that
they pass, not only for long ones, and their noise is of equal power and not correlated: total least squares, which is
the direction of the smaller eigenvector of [Σ I_x², Σ I_x I_t; Σ I_x I_t, Σ I_t²], has no bias at low contrast, where
−Σ I_x I_t/Σ I_x² has. What a change of light adds to I_t, g I + b, and what vignetting adds to I_x, planes over the
window, are regressed out of both first.

The flow is that of two frames before the last one.
"""

from math import nan, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.flow.derivatives import FIVE
from perception.flow.window import Image, Window, WindowFlow, check_image

Field = NDArray[np.float32]

FRAMES = 5
EDGE = 2
"""Pixels the filters reach beyond the window; the window loses them where the image ends."""
COHERENCE = 0.3
"""(λ₁ − λ₂)/(λ₁ + λ₂) above which it is texture: noise reaches .22, contrast .05 (σ 2 in noise of 2) .4."""
LEAST_POWER = FIVE.slope_power * FIVE.level_power**2
"""Of a pixel's I_x: that of white noise of one grey level. The bands that rounding makes of light have less."""
LEAST_DEVIATION_PX = 1e-3
MOST_PX = 3.0
"""Above, the frames are too far apart in time for their waves, and the flow is wrong by more than 1 %."""
UNKNOWN = WindowFlow(nan, nan, False)
ORDERS = np.stack([np.roll(np.stack((FIVE.level, FIVE.slope), axis=1), k, axis=0) for k in range(FRAMES)])
"""Both filters' weights of the five places, which the frames take in turn: [k] when the oldest stands at place k."""


class OnePassFlow:
    """Takes frames one by one, all as far apart in time; from the fifth on every one gives a flow in px a frame."""

    def __init__(self, window: Window) -> None:
        self.window = window
        self._size = (0, 0)
        self._taken = 0
        self._contrast = 0.0

    def step(self, image: Image) -> WindowFlow | None:
        """The flow two frames before this one, None for the first four; raises ImageError."""
        check_image(image, self.window)
        if image.shape != self._size:
            self._start(image.shape[0], image.shape[1])
        crop = image[self._outer]
        mean, deviation = (float(m[0, 0]) for m in cv2.meanStdDev(crop))
        # Flicker is taken out frame by frame: as it multiplies the slopes too, no gain of the mean image makes it good.
        scale = np.float32(1 / deviation if deviation > 0 else 0.0)
        self._contrast = deviation
        self._frames[:, self._taken % FRAMES] = ((crop - np.float32(mean)) * scale).ravel()
        self._taken += 1
        if self._taken < FRAMES:
            return None
        # Low-pass and derivative in time, as two channels.
        both = (self._frames @ ORDERS[self._taken % FRAMES]).reshape(*self._shape, 2)
        level = cv2.sepFilter2D(both, cv2.CV_32F, FIVE.level, FIVE.level)[self._inner]
        along_x = cv2.sepFilter2D(both[:, :, 0], cv2.CV_32F, FIVE.slope, FIVE.level)[self._inner]
        self._fields[3], self._fields[4], self._fields[5] = level[:, :, 0], along_x, level[:, :, 1]
        return _solve(self._fields, self._contrast)

    def _start(self, height: int, width: int) -> None:
        window = self.window
        left, top = max(window.left - EDGE, 0), max(window.top - EDGE, 0)
        right, bottom = (
            min(window.left + window.width + EDGE, width),
            min(window.top + window.height + EDGE, height),
        )
        self._outer = (slice(top, bottom), slice(left, right))
        self._shape = (bottom - top, right - left)
        rows = slice(window.top - top, window.top - top + window.height)
        self._inner = (rows, slice(EDGE, right - left - EDGE))
        self._frames = np.zeros((self._shape[0] * self._shape[1], FRAMES), np.float32)
        y, x = np.mgrid[-1 : 1 : window.height * 1j, -1 : 1 : (right - left - 2 * EDGE) * 1j]
        self._fields = np.stack((np.ones_like(x), x, y, x, x, x)).astype(np.float32)
        self._size, self._taken = (height, width), 0


def _solve(fields: Field, contrast: float) -> WindowFlow:
    """Total least squares from 1, x, y, I, I_x and I_t, in parts of that many grey levels."""
    flat = fields.reshape(len(fields), -1)
    moments = np.asarray(flat @ flat.T, np.float64)
    regular, inverse = cv2.invert(moments[:4, :4])
    if not regular:
        return UNKNOWN
    share = inverse @ moments[:4, 4:]
    (xx, xt), (_, tt) = moments[4:, 4:] - moments[4:, :4] @ share
    if not xx * contrast**2 > LEAST_POWER * fields[0].size:
        return UNKNOWN
    spread = sqrt((xx - tt) ** 2 + 4 * xt * xt)
    if not spread > COHERENCE * (xx + tt) or not spread + xx - tt > 0:
        return UNKNOWN
    flow = -2 * xt / (spread + xx - tt)
    if not abs(flow) <= MOST_PX:
        return WindowFlow(nan, nan, True)
    # Σ e²/(1 + u²), e = I_t + u I_x, has the slope Σ e z in u, and e the noise of five frames behind its filters.
    tall = 1 + flow * flow
    error = np.hstack((-share @ (flow, 1), (flow, 1)))
    lever = np.hstack((-share[:, 0], (1, 0))) - flow / tall * error
    error_field, lever_field = np.stack((error, lever)).astype(np.float32) @ flat
    lever_field = lever_field.reshape(fields.shape[1:])
    by_level = cv2.sepFilter2D(
        lever_field, cv2.CV_32F, FIVE.level, FIVE.level, borderType=cv2.BORDER_CONSTANT
    )
    by_slope = cv2.sepFilter2D(
        lever_field, cv2.CV_32F, FIVE.slope, FIVE.level, borderType=cv2.BORDER_CONSTANT
    )
    noise = float(np.vdot(error_field, error_field)) / error_field.size
    noise /= tall * FIVE.slope_power * FIVE.level_power**2
    power = FIVE.slope_power * float(np.vdot(by_level, by_level))
    power += flow * flow * FIVE.level_power * float(np.vdot(by_slope, by_slope))
    deviation = max(sqrt(noise * power) * tall / spread, LEAST_DEVIATION_PX)
    return WindowFlow(float(flow), float(deviation), True)
