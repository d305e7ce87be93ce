"""How much the predictive pursuit bears: gain and phase margins of its loop at the retina."""

import cmath
import math
from dataclasses import dataclass

from medusa.gaze.prediction import steady_gains


@dataclass(frozen=True)
class Margins:
    """Gain margin (factor), phase margin [rad] and the delay [s] that uses it up, at the crossover [rad/s]."""

    gain: float
    phase: float
    delay: float
    crossover: float


def prediction_response(
    acceleration: float, sigma: float, frame_period: float, latency: float, z: complex
) -> complex:
    """H(z), from the measured bearing to the gaze at the same instants, of the filter with its settled gains.

    Filter: x̂ = x̂₋ + α(y − x̂₋), v̂ = v̂₋ + β/T (y − x̂₋), x̂₋ = x̂ + T v̂. The gaze at an exposure is the
    prediction over n frames, n = 1 + ⌊latency/T⌋: the newest picture whose command acted before that
    exposure. So H = z⁻ⁿ (x̂ + nT v̂)/y.
    """
    alpha, rate = steady_gains(acceleration, sigma, frame_period)
    t = frame_period
    # x̂(1 − (1−α)z⁻¹) = (1−α)T z⁻¹ v̂ + α y;  v̂ = z⁻¹ v̂ + rate (y − z⁻¹(x̂ + T v̂))
    back = 1 / z
    a11, a12 = 1 - (1 - alpha) * back, -(1 - alpha) * t * back
    a21, a22 = rate * back, 1 - back + rate * t * back
    determinant = a11 * a22 - a12 * a21
    position = (alpha * a22 - a12 * rate) / determinant
    velocity = (a11 * rate - a21 * alpha) / determinant
    frames = 1 + math.floor(latency / frame_period + 1e-9)
    return back**frames * (position + frames * frame_period * velocity)


def pursuit_margins(acceleration: float, sigma: float, frame_period: float, latency: float) -> Margins:
    """Margins of the loop broken at the retinal error e.

    The filter is given y = θ + e, the gaze is θ = H y, so θ = L e with L = H/(1 − H). Were optics, angles
    and kinematics exact, no loop would be left; the margins say by how much the image scale, or the delay,
    may be off.
    """

    def loop(omega: float) -> complex:
        h = prediction_response(
            acceleration, sigma, frame_period, latency, cmath.exp(1j * omega * frame_period)
        )
        return h / (1 - h)

    steps = 4000
    grid = [math.pi / frame_period * (k + 1) / steps for k in range(steps)]
    values = [loop(w) for w in grid]
    gain = math.inf
    phase, crossover = math.inf, math.nan
    for w, before, after in zip(grid[1:], values, values[1:], strict=False):
        if before.imag * after.imag <= 0 and min(before.real, after.real) < 0 and before.imag != after.imag:
            share = before.imag / (before.imag - after.imag)
            real = before.real + share * (after.real - before.real)
            if -1.0 < real < 0:
                gain = min(gain, -1 / real)
        if (abs(before) - 1) * (abs(after) - 1) <= 0 and abs(before) != abs(after):
            margin = abs(math.pi - abs(cmath.phase(after)))
            if margin < phase:
                phase, crossover = margin, w
    last = values[-1]
    if abs(last.imag) < 1e-6 and -1 < last.real < 0:
        gain = min(gain, -1 / last.real)
    return Margins(gain, phase, phase / crossover, crossover)
