"""Between which inverse depths to search: what is predicted, or what the coarsest level of the pyramid finds."""

import cv2
import numpy as np

from perception.depth.epipolar import Epipolar
from perception.depth.inverse_depth import InverseDepth
from perception.depth.settings import Settings
from perception.depth.sweep_choice import choose_planes
from perception.depth.view import View

WIDEST = 0.35
"""Greatest disparity searched, as a part of the picture's width."""
MARGIN_PX = 2.0
MARGIN_PART = 0.15
"""Room for what comes nearer or into view: so many pixels, or this part of the nearest inverse depth."""


def search_range(
    base: View, other: View, geometry: Epipolar, predicted: InverseDepth, settings: Settings
) -> tuple[float, float]:
    """Least and greatest inverse depth worth searching, within the settings' `near` and `far`."""
    lowest, highest = 1 / settings.far, 1 / settings.near
    widest = WIDEST * base.shape[1]
    while geometry.parallax(highest, lowest) > widest and highest > lowest * 1.01:
        highest = max(highest * 0.9, lowest * 1.01)
    known = np.isfinite(predicted.value) & (predicted.cost < 1)
    if known.mean() > 0.4:
        low, high = np.percentile(predicted.value[::2, ::2][known[::2, ::2]], (0.5, 99.5))
    else:
        low, high = _coarse_range(base, other, geometry, lowest, highest, settings)
    margin = MARGIN_PX * (highest - lowest) / max(geometry.parallax(highest, lowest), 1e-6)
    low, high = (
        max(lowest, float(low) - margin),
        min(highest, float(high) + max(margin, MARGIN_PART * float(high))),
    )
    return (low, high) if high > low else (lowest, highest)


def _coarse_range(
    base: View, other: View, geometry: Epipolar, lowest: float, highest: float, settings: Settings
) -> tuple[float, float]:
    level, level_other = base.level(settings.levels - 1), other.level(settings.levels - 1)
    shape = level.shape
    coarse = Epipolar(geometry.camera.scaled(shape[1] / base.shape[1]), geometry.motion, shape)
    planes = coarse.planes(lowest, highest)
    choice = choose_planes(level, level_other, coarse, planes, InverseDepth.unknown(shape), settings)
    sure = cv2.erode(choice.sure.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    if sure.mean() < 0.02:
        return lowest, highest
    found = np.percentile(choice.inverse_depth[sure], (0.5, 99.5))
    return float(found[0]), float(found[1])
