"""The outline of a surface drawn back to where the image changes.

A window that holds two surfaces matches by the one with more texture, so that a surface grows over its
outline by up to half the window, and the other image, matched by the same windows, confirms it.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]

REACH = 5
"""Half the window, in pixels, within which a pixel is given to the one surface or the other."""
HALO = 3 * REACH
"""Rows that a pixel's answer depends on, above and below: a middle over twice the reach, and a window of it."""
LEAST_STEP = 1.5
"""Disparities (px) that differ by less within the window are one surface."""
LEAST_PART = 0.05
"""A surface that fills less of the window than this part has no grey level of its own."""
EVIDENCE = 2.5
"""By how much −2 ln of the likelihood must be better on the other side; a lower bar follows the texture."""


def align_outlines(disparity: Field, grey: Field, noise: float) -> Field:
    """Give the pixels beside a step of the disparity to the surface whose grey levels they have.

    Around each such pixel the window is parted in a near and a far side at the middle between its greatest and
    its least disparity. Each side has a mean μ and a variance σ² of its grey levels g, and
    e = (g − μ)²/σ² + ln σ² is −2 ln of a normal likelihood (Chan and Vese's energy of a region, in a window). A
    pixel for which e is less on the other side by more than `EVIDENCE` takes that side's mean disparity.

    Args:
        disparity: height × width, px, no NaN.
        grey: the image, grey levels.
        noise: standard deviation of its noise, which no side's σ falls below.
    """
    side = (2 * REACH + 1, 2 * REACH + 1)
    window = np.ones(side, np.uint8)
    most, least = cv2.dilate(disparity, window), cv2.erode(disparity, window)
    beside = np.flatnonzero(most - least > LEAST_STEP)
    if beside.size == 0:
        return disparity
    # All of a window is parted at one middle: that of twice the reach, which holds both sides at its every pixel.
    middle = 0.5 * (cv2.dilate(most, window) + cv2.erode(least, window))
    near = (disparity > middle).astype(np.float32)

    def mean(values: Field) -> Field:
        return np.asarray(cv2.blur(values, side).ravel()[beside], np.float32)

    part = mean(near)
    square, near_grey = grey * grey, near * grey
    whole = tuple(mean(values) for values in (grey, square, disparity))
    inside = tuple(mean(values) for values in (near_grey, near_grey * grey, near * disparity))
    outside = tuple(all_of_it - one for all_of_it, one in zip(whole, inside, strict=True))
    level = grey.ravel()[beside]

    def judge(sums: tuple[Field, ...], share: Field) -> tuple[Field, Field]:
        middle, power, place = (total / np.maximum(share, np.float32(LEAST_PART)) for total in sums)
        # Grey levels are whole numbers: one level of uncertainty beside the noise.
        variance = np.maximum(power - middle * middle, 0) + np.float32(noise * noise + 1)
        error: Field = np.asarray(np.square(level - middle) / variance + np.log(variance), np.float32)
        return error, np.asarray(place, np.float32)

    error_near, place_near = judge(inside, part)
    error_far, place_far = judge(outside, 1 - part)
    two = (part > LEAST_PART) & (part < 1 - LEAST_PART)
    is_near = near.ravel()[beside] > 0
    to_far = two & is_near & (error_far + np.float32(EVIDENCE) < error_near)
    to_near = two & ~is_near & (error_near + np.float32(EVIDENCE) < error_far)
    aligned = disparity.copy()
    aligned.flat[beside[to_far]] = place_far[to_far]
    aligned.flat[beside[to_near]] = place_near[to_near]
    return aligned
