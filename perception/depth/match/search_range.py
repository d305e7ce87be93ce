"""Between which inverse depths to search: what the map has led to expect, or all that the settings allow."""

import numpy as np

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.settings import DepthSettings
from perception.image.quantile import quantiles

Range = tuple[float, float]
WIDEST = 0.35
"""Greatest disparity searched, as a part of the image's width."""
MARGIN_PX = 2.0
MARGIN_PART = 0.15
"""Margin for what comes nearer or into view: so many pixels, or this part of the nearest inverse depth."""
KNOWN_PART = 0.4
"""A map with depth at less than this part of its pixels leads to expect nothing."""


def widest_range(geometry: Epipolar, settings: DepthSettings) -> Range:
    """From `far` to `near`, as far as the disparity stays below `WIDEST`."""
    lowest, highest = 1 / settings.far, 1 / settings.near
    widest = WIDEST * geometry.shape[1]
    while geometry.parallax(highest, lowest) > widest and highest > lowest * 1.01:
        highest = max(highest * 0.9, lowest * 1.01)
    return lowest, highest


def expected_range(state: InverseDepth, shift_z: float) -> Range | None:
    """Between which inverse depths all but a hundredth of the map lies after a motion; None if too little is known.

    ρ' = ρ/(1 + b ρ) of (2.21) in the middle of the image.

    Args:
        shift_z: b, the third component of the motion's translation, m.
    """
    value, cost = state.value[::2, ::2], state.cost[::2, ::2]
    known = np.isfinite(value) & (cost < 1)
    if known.mean() <= KNOWN_PART:
        return None
    low, high = quantiles(value[known], 0.005, 0.995)
    if 1 + shift_z * high < 0.1:
        return None
    return low / (1 + shift_z * low), high / (1 + shift_z * high)


def with_margin(expected: Range, limits: Range, geometry: Epipolar) -> Range:
    """The expected range with a margin for what comes nearer or into view, inside the limits; all in 1/m."""
    lowest, highest = limits
    margin = MARGIN_PX * (highest - lowest) / max(geometry.parallax(highest, lowest), 1e-6)
    low = max(lowest, expected[0] - margin)
    high = min(highest, expected[1] + max(margin, MARGIN_PART * expected[1]))
    return (low, high) if high > low else limits
