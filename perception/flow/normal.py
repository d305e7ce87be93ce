"""Dense normal flow: the part of the motion along the gradient of the image, with a standard deviation a pixel."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Field = NDArray[np.float32]
BLUR = np.array([0.037659, 0.249153, 0.426375, 0.249153, 0.037659], np.float32)
SLOPE = np.array([-0.109604, -0.276691, 0, 0.276691, 0.109604], np.float32)
"""Prefilter and derivative that match: the derivative of what the prefilter leaves (Simoncelli 1994)."""
TEMPORAL = {
    2: ((0.5, 0.5), (-1.0, 1.0)),
    3: ((1 / 6, 2 / 3, 1 / 6), (-0.5, 0.0, 0.5)),
    4: ((0.092645, 0.407355, 0.407355, 0.092645), (-0.236506, -0.267576, 0.267576, 0.236506)),
    5: (tuple(BLUR.tolist()), tuple(SLOPE.tolist())),
}
"""The same across 2 to 5 frames; of 3, whose ratio is iω to the fourth order."""
BEND = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
LEAST = 3.0
"""A slope of fewer deviations of its own noise has no direction."""
FLOOR_PX = 0.06
"""What aliasing moves an edge by."""
CURVED = 0.18
"""What the first order misses, as a part of the flow."""
MISFIT = 0.84
"""What the pixels around miss of one common motion, as a part of what this one may."""
AROUND_PX = 2.5
"""Standard deviation of the Gaussian over which the misfit is taken."""
WINDOW_PX = 3.75
"""… and over which least squares find the motion by which the second frame is warped."""
LEVELS = 4
MOST_PX = 1.5
"""A step of the coarse flow is cut at this many pixels of its level."""


@dataclass(frozen=True, eq=False)
class NormalFlow:
    """Normal flow u_n = n·u of every pixel, n = ∇I/|∇I|, height × width; NaN where the gradient is but noise."""

    flow: Field
    """px a frame, positive toward brighter grey."""
    std: Field
    slope_x: Field
    """∂I/∂x, grey/px."""
    slope_y: Field

    @cached_property
    def strength(self) -> Field:
        """|∇I|, grey/px."""
        return np.asarray(cv2.magnitude(self.slope_x, self.slope_y), np.float32)


def estimate_normal_flow(frames: Sequence[Image], noise: float | None = None) -> NormalFlow:
    """u_n = −I_t/|∇I|, thesis (3.5) with its sign, in the middle of 2 to 5 successive frames; for up to about a pixel.

    Its variance is (σ_t/|∇I|)² + .06² + (.18 u_n)²: noise, aliasing, and what the first order misses.

    Args:
        frames: grey images of one size, in their order.
        noise: standard deviation of their grey levels; estimated from the last when it is not given.

    Raises:
        ValueError: fewer than 2 or more than 5 frames, or of different sizes.
    """
    slope_x, slope_y, rate = _derivatives(frames)
    strength = cv2.magnitude(slope_x, slope_y)
    slope_noise, rate_noise = _filtered(estimate_noise(frames[-1]) if noise is None else noise, len(frames))
    flow = cv2.divide(rate, strength, scale=-1.0)
    noisy = cv2.divide(rate_noise, strength)
    std = cv2.sqrt(noisy * noisy + np.float32(CURVED**2) * flow * flow + np.float32(FLOOR_PX**2))
    np.copyto(flow, np.nan, where=strength < LEAST * slope_noise)
    return NormalFlow(np.asarray(flow, np.float32), np.asarray(std, np.float32), slope_x, slope_y)


def estimate_warped_normal_flow(first: Image, second: Image, noise: float | None = None) -> NormalFlow:
    """Normal flow from one frame to the next over several pixels: the second is warped once, what is left is measured.

    It is warped by the motion that least squares over windows find, coarse to fine, down to half the size. The
    variance takes in what the pixels around miss of one common motion: σ² = (σ_t² + (.84 e)²)/|∇I|² + .06²,
    e² = Ī_t² − bᵀA⁻¹b.

    Args:
        first, second: grey, of one size.
        noise: standard deviation of their grey levels; estimated when it is not given.
    """
    coarse = _flow_coarse_to_fine(first, second)
    warped = _warp(np.asarray(second, np.float32), coarse)
    slope_x, slope_y, rate = _derivatives((np.asarray(first, np.float32), warped))
    strength = cv2.magnitude(slope_x, slope_y)
    slope_noise, rate_noise = _filtered(estimate_noise(first) if noise is None else noise, 2)
    _, misfit = _common_motion(slope_x, slope_y, rate, AROUND_PX, slope_noise**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        flow = (slope_x * coarse[..., 0] + slope_y * coarse[..., 1] - rate) / strength
        std = np.sqrt(
            (np.float32(rate_noise**2) + np.float32(MISFIT**2) * misfit) / strength**2
            + np.float32(FLOOR_PX**2)
        )
    flow[strength < LEAST * slope_noise] = np.nan
    return NormalFlow(flow, std, slope_x, slope_y)


def estimate_noise(image: NDArray[np.uint8] | Field) -> float:
    """Standard deviation of the noise of an image: median of |∂²/∂x² ∂²/∂y²| in its middle rows: texture spares it.

    Never less than what rounding to whole grey levels leaves (Immerkær 1996, with a median).
    """
    middle = image[3 * image.shape[0] // 8 : 5 * image.shape[0] // 8]
    bend = cv2.filter2D(middle, cv2.CV_32F, BEND)
    some = np.sort(np.abs(bend.ravel()[::5]))
    return max(float(some[some.size // 2]) / (0.6745 * 6), 12**-0.5)


def _derivatives(frames: Sequence[NDArray[np.uint8] | Field]) -> tuple[Field, Field, Field]:
    if len(frames) not in TEMPORAL:
        raise ValueError(f"normal flow of {len(frames)} frames: 2 to 5 are needed")
    if any(frame.shape != frames[0].shape for frame in frames):
        raise ValueError(f"frames of different sizes: {[frame.shape for frame in frames]}")
    blur, slope = TEMPORAL[len(frames)]
    if len(frames) == 2:
        mean = cv2.addWeighted(frames[0], 0.5, frames[1], 0.5, 0, dtype=cv2.CV_32F)
        change = cv2.subtract(frames[1], frames[0], dtype=cv2.CV_32F)
    else:
        stack = np.stack(frames).astype(np.float32).reshape(len(frames), -1)
        weights = np.array((blur, slope), np.float32)
        mean, change = (weights @ stack).reshape(2, *frames[0].shape)
    return (
        np.asarray(cv2.sepFilter2D(mean, cv2.CV_32F, SLOPE, BLUR), np.float32),
        np.asarray(cv2.sepFilter2D(mean, cv2.CV_32F, BLUR, SLOPE), np.float32),
        np.asarray(cv2.sepFilter2D(change, cv2.CV_32F, BLUR, BLUR), np.float32),
    )


def _filtered(noise: float, frames: int) -> tuple[float, float]:
    """Standard deviations that white noise leaves in the slopes and in the rate."""
    blur, slope = (float(np.linalg.norm(part)) for part in TEMPORAL[frames])
    across, along = float(np.linalg.norm(BLUR)), float(np.linalg.norm(SLOPE))
    return noise * blur * across * along, noise * slope * across * across


def _common_motion(
    slope_x: Field, slope_y: Field, rate: Field, around: float, noise: float
) -> tuple[Field, Field]:
    """The motion that explains the pixels around best, and the mean square rate that it leaves."""
    products = (
        slope_x * slope_x,
        slope_x * slope_y,
        slope_y * slope_y,
        slope_x * rate,
        slope_y * rate,
        rate * rate,
    )
    xx, xy, yy, xt, yt, tt = (cv2.GaussianBlur(product, (0, 0), around) for product in products)
    # Where there is no texture, no motion.
    xx, yy = xx + np.float32(noise), yy + np.float32(noise)
    area = xx * yy - xy * xy
    across, down = (xy * yt - yy * xt) / area, (xy * xt - xx * yt) / area
    left = np.maximum(tt + across * xt + down * yt, 0)
    return np.asarray(cv2.merge((across, down)), np.float32), left


def _flow_coarse_to_fine(first: Image, second: Image) -> Field:
    """About how everything moves, px, height × width × 2."""
    pairs = [(np.asarray(first, np.float32), np.asarray(second, np.float32))]
    while len(pairs) < LEVELS and min(pairs[-1][0].shape) >= 32:
        one, other = (np.asarray(cv2.pyrDown(frame), np.float32) for frame in pairs[-1])
        pairs.append((one, other))
    flow = np.zeros((*pairs[-1][0].shape, 2), np.float32)
    for one, other in reversed(pairs[1:]):
        flow = _enlarge(flow, one.shape)
        step, _ = _common_motion(*_derivatives((one, _warp(other, flow))), WINDOW_PX, 1.0)
        length = np.hypot(step[..., 0], step[..., 1]) / np.float32(MOST_PX)
        step /= np.maximum(length, 1)[..., None]
        flow = _median(flow + step)
    return _enlarge(flow, first.shape)


def _enlarge(flow: Field, shape: tuple[int, ...]) -> Field:
    """The flow of a coarse level in the pixels of a finer one."""
    if flow.shape[:2] == shape[:2]:
        return flow
    scale = np.float32(shape[1] / flow.shape[1]), np.float32(shape[0] / flow.shape[0])
    return np.asarray(cv2.resize(flow, (shape[1], shape[0])) * np.array(scale), np.float32)


def _median(flow: Field) -> Field:
    return np.asarray(cv2.merge([cv2.medianBlur(part, 5) for part in cv2.split(flow)]), np.float32)


def _warp(image: Field, flow: Field) -> Field:
    x, y = np.arange(flow.shape[1], dtype=np.float32), np.arange(flow.shape[0], dtype=np.float32)[:, None]
    return np.asarray(
        cv2.remap(
            image, flow[..., 0] + x, flow[..., 1] + y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        ),
        np.float32,
    )
