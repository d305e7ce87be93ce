"""The horizontal shift of a window between two images, to its standard deviation, by warped least squares.

The present window I and the past image J are the same texture moved by u(x) = u₀ + u₁ x̂, x̂ = −1…1 across the window,
under another light: I(x) = g J(x − u(x)) + b. Newton's steps on the four of u₀, u₁, g, b solve

    Σ z ψ(r) = 0,  r = I − g J(x − u) − b,  z = (I_x, x̂ I_x, J, 1),  ψ(r) = r w(r), Tukey's

The slope of either image carries noise, but not the other one's: in A, the derivative of these sums, stands
Σ ψ′ I_x J_x, which is free of it, where Σ I_x² is not. So a step is right at any contrast; and as h and h′
(sampling.py) are even and odd, noise moves no solution.

The covariance is A⁻¹ (G w z)(G w z)ᵀ A⁻ᵀ σ², G the filter that the noise has passed: neighbours err together.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, floor, isnan, nan, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.flow.sampling import LEVEL_NOISE, LEVEL_TAPS, REACH, pixel_matrix, sampling_matrix
from perception.flow.search import Search
from perception.flow.strip import DOWN, DOWN_NOISE, Strip
from perception.flow.weights import weigh
from perception.flow.window import Window

Field = NDArray[np.float32]

MOST_STEPS = 6
ENOUGH_PX, ENOUGH_GAIN = 0.1, 0.1
"""A step below these is the last one: the next would be about its cube, .001 px."""
FAR_PX = 0.25
"""A step beyond this is taken by the weights themselves, which never point the wrong way."""
STRAY_PX = 1.5
"""A solution farther than this from where the search saw it is another one."""
STEEPEST_PART = 0.25
"""Slopes beyond this part of the window's width stretch it to twice or half."""
LEAST_LEFT = 0.1
"""Of the residuals' power before the last step, at least: that step is taken to explain no more."""
BLOCK = 8
"""Columns of a block, of which each must agree with the flow of the whole."""
NOISE_MISFIT = 4.0
"""χ² a degree of freedom that noise exceeds in less than one of a thousand windows (six degrees: 22.5 in all). What is
above is not one straight line of flow, and the deviations grow by as much."""
MOST_MISFIT, LEAST_CORRELATION = 25.0, 0.3
"""Of a shift that is one of several: the right one fits."""
FINE_EXCESS = 0.15
"""A 1/f texture's slopes correlate less than its coarse image, or by this more where that is half a pixel off."""
LEAST_DEVIATION_PX = 1e-3
"""What the rounding of places (sampling.py) and of grey levels leaves."""
LEAST_BLOCK = 1e-3
FEWEST_COLUMNS = 16


@dataclass(frozen=True, slots=True)
class Shift:
    """How far the window's content has moved to the right, in its middle, and the standard deviation; px."""

    middle_px: float
    deviation_px: float
    slope_px: float
    """The flow at the window's right edge minus that in its middle."""
    slope_deviation_px: float
    correlation: float
    """Of the slopes of both images at the shift."""
    misfit: float
    """χ² a degree of freedom of the blocks of columns against one straight line of flow: 1 of noise alone."""


UNKNOWN = Shift(nan, nan, nan, nan, nan, nan)


def align(
    now: Strip,
    past: Strip,
    window: Window,
    found: Search,
    start_px: float,
    slope_px: float = 0.0,
    curve_px: float = 0.0,
) -> Shift:
    """The shift near one peak of a search.

    It begins with the slope that the search saw, if the peak is the only one: the halves of striped windows may see
    other stripes. Else, or if that leads nowhere, with the slope given.
    """
    start_px -= curve_px / 3
    seen_px = found.slope_at(start_px) if found.clear else slope_px
    shift = estimate_shift(now, past, window, start_px, seen_px, curve_px)
    if shift is UNKNOWN and seen_px != slope_px:
        shift = estimate_shift(now, past, window, start_px, slope_px, curve_px)
    # Waves too short for the search may fit at any of their periods; and of several shifts only a faultless one counts.
    too_fine = shift.correlation > float(found.scores.max()) + FINE_EXCESS
    faulty = shift.misfit > MOST_MISFIT or shift.correlation < LEAST_CORRELATION
    return UNKNOWN if too_fine or (faulty and not found.clear) else shift


def estimate_shift(
    now: Strip, past: Strip, window: Window, start_px: float, slope_px: float = 0.0, curve_px: float = 0.0
) -> Shift:
    """The shift of the window near `start_px` (within a pixel); UNKNOWN where there is none.

    Args:
        slope_px: first guess of the flow at the right edge minus that in the middle.
        curve_px: how far the flow at both edges lies above a straight line on the mean; it stays as it is.
    """
    first, count = _shared_columns(now, past, window, start_px, abs(slope_px))
    if count < FEWEST_COLUMNS:
        return UNKNOWN
    columns, across = _axes(first, count, window)
    wide = across[:, None]
    if curve_px:
        columns = columns - np.float32(curve_px) * across * across
    own = pixel_matrix(first - now.first, count, now.columns) @ now.grey
    level, slope = own[:count], own[count:]
    middle, edge, gain, offset = start_px, slope_px, _contrast(now, past, first, count, start_px), nan
    left, right = np.empty((2, 4, count, window.height), np.float32)
    left[0], left[3] = slope, 1
    np.multiply(slope, wide, out=left[1])
    flat, flat_right = left.reshape(4, -1), right.reshape(4, -1)
    far = False
    for _ in range(MOST_STEPS):
        if not (abs(middle - start_px) <= STRAY_PX and abs(edge) <= STEEPEST_PART * window.width):
            return UNKNOWN
        both = _sample(past, columns - np.float32(middle) - np.float32(edge) * across)
        if both is None:
            return UNKNOWN
        other, other_slope = both[:count], both[count:]
        left[2] = other
        rest = other * np.float32(-gain)
        rest += level
        offset = cv2.mean(rest)[0] if isnan(offset) else offset
        rest -= np.float32(offset)
        weight, bend = weigh(rest)
        if far:
            bend = weight
        np.multiply(other_slope, bend, out=right[0])
        np.multiply(right[0], wide, out=right[1])
        np.multiply(other, bend, out=right[2])
        right[3] = bend
        rest *= weight
        system = np.asarray(flat @ flat_right.T, np.float64)
        system[:, :2] *= -1
        regular, inverse = cv2.invert(system)
        if not regular:
            return UNKNOWN
        pulls = flat @ rest.ravel()
        step = inverse @ pulls
        size = abs(step[0]) + abs(step[1]) / 3
        if size > FAR_PX and not far:
            far = True
            continue
        middle, edge, gain, offset = middle + step[0], edge + step[1], gain + step[2], offset + step[3]
        if size < ENOUGH_PX and abs(step[2]) < ENOUGH_GAIN and not far:
            break
        far = far and size > ENOUGH_PX
    else:
        return UNKNOWN
    misfit, power = _misfit(left[0] * rest, left[0] * right[0], across, float(step[0]), float(step[1]))
    correlation = power / sqrt(float(np.vdot(slope, slope)) * float(np.vdot(other_slope, other_slope)))
    # What the last step explains is not looked at again, it is taken off the residuals' power.
    seen = float(np.vdot(rest, rest))
    left_over = max(seen + float(pulls[:2] @ step[:2] - pulls[2:] @ step[2:]), LEAST_LEFT * seen)
    field = (inverse[0].astype(np.float32) @ flat).reshape(weight.shape) * weight
    variance = _variance(field, left_over / float(np.vdot(weight, weight)))
    misfit /= variance * power
    if misfit > NOISE_MISFIT:
        variance *= misfit
    deviation = sqrt(variance)
    tilt = sqrt(abs(inverse[1, 1] / inverse[0, 0]))
    return Shift(float(middle), deviation, float(edge), deviation * tilt, correlation, misfit)


def _sample(past: Strip, places: Field) -> Field | None:
    """Levels and slopes of the past image at places, ascending columns of the image; None when it lacks any."""
    begin = max(floor(places[0]) - REACH, past.first)
    some = past.grey[begin - past.first : ceil(places[-1]) + REACH + 1 - past.first]
    matrix = sampling_matrix(places - np.float32(begin), len(some))
    return None if matrix is None else np.asarray(matrix @ some, np.float32)


def _misfit(pull: Field, power: Field, across: Field, middle: float, edge: float) -> tuple[float, float]:
    """Σ b²/h over blocks of columns, a degree of freedom, and Σ h.

    b is what still pulls at a block's shift after the step (middle, edge), h its power. If one straight line of flow is
    true for all blocks, Σ b²/h is σ² Σ h for every degree of freedom, σ² the variance of the whole window's shift.
    """
    count = len(across) // BLOCK
    columns = count * BLOCK
    powers = np.maximum(power[:columns].reshape(count, -1).sum(axis=1), LEAST_BLOCK)
    pulls = pull[:columns].reshape(count, -1).sum(axis=1)
    pulls += powers * (middle + edge * across[BLOCK // 2 : columns : BLOCK])
    return float(pulls @ (pulls / powers)) / max(count - 2, 1), float(powers.sum())


def _variance(field: Field, noise: float) -> float:
    """Of u₀: what white noise does to it through the filters G and its row of A⁻¹ w z.

    noise: the residuals' power, that is of the noise behind G.
    """
    spread = cv2.sepFilter2D(field, cv2.CV_32F, DOWN, LEVEL_TAPS, borderType=cv2.BORDER_CONSTANT)
    return max(noise / (LEVEL_NOISE * DOWN_NOISE) * float(np.vdot(spread, spread)), LEAST_DEVIATION_PX**2)


def _contrast(now: Strip, past: Strip, first: int, count: int, shift: float) -> float:
    """First guess of the gain, by the power of the same columns."""
    begin = first - past.first - round(shift)
    power = float(past.power[begin : begin + count].sum())
    return sqrt(float(now.power[first - now.first :][:count].sum()) / power) if power > 0 else 1.0


@lru_cache(maxsize=16)
def _axes(first: int, count: int, window: Window) -> tuple[Field, Field]:
    """The columns in the image's count, and as −1…1 across the window."""
    columns = np.arange(first, first + count, dtype=np.float32)
    return columns, (columns - np.float32(window.middle)) * np.float32(2 / window.width)


def _shared_columns(now: Strip, past: Strip, window: Window, shift: float, more: float) -> tuple[int, int]:
    """First column of the window that both images show, with room for the filters and a stray step, and how many."""
    room = REACH + STRAY_PX + more
    first = max(window.left, now.first + REACH, past.first + ceil(shift + room))
    last = min(
        window.left + window.width,
        now.first + now.columns - REACH,
        past.first + past.columns + floor(shift - room),
    )
    return first, last - first
