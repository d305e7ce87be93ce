"""Between which inverse depths to search: what is predicted, or what the coarsest level of the pyramid finds."""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.consistency import agree, backward_planes
from perception.depth.contrast import equalised_slopes, estimate_noise
from perception.depth.epipolar import Epipolar
from perception.depth.inverse_depth import InverseDepth
from perception.depth.pyramid import build_pyramid
from perception.depth.scanline import aggregate, choose, jump_costs
from perception.depth.settings import Settings
from perception.depth.sweep import WORST, sweep_planes

Field = NDArray[np.float32]
WIDEST = 0.35
"""Greatest disparity searched, as a part of the picture's width."""
MARGIN_PX = 2.0


def search_range(
    base: Field, other: Field, geometry: Epipolar, predicted: InverseDepth, settings: Settings
) -> tuple[float, float]:
    """Least and greatest inverse depth worth searching, within the settings' `near` and `far`."""
    lowest, highest = 1 / settings.far, 1 / settings.near
    widest = WIDEST * base.shape[1]
    while geometry.parallax(highest, lowest) > widest and highest > lowest * 1.01:
        highest = max(highest * 0.9, lowest * 1.01)
    known = np.isfinite(predicted.value)
    if known.mean() > 0.5:
        value, spread = predicted.value[known], 3 * np.sqrt(predicted.variance[known])
        found = float(np.percentile(value - spread, 1)), float(np.percentile(value + spread, 99))
    else:
        found = _coarse_range(base, other, geometry, lowest, highest)
    margin = MARGIN_PX * (highest - lowest) / max(geometry.parallax(highest, lowest), 1e-6)
    low = max(lowest, found[0] - margin)
    high = min(highest, max(found[1] * 1.15, found[1] + margin))
    return (low, high) if high > low else (lowest, highest)


def _coarse_range(
    base: Field, other: Field, geometry: Epipolar, lowest: float, highest: float
) -> tuple[float, float]:
    level, level_other = build_pyramid(base, 3)[-1], build_pyramid(other, 3)[-1]
    shape = (level.shape[0], level.shape[1])
    coarse = Epipolar(geometry.camera.scaled(shape[1] / base.shape[1]), geometry.motion, shape)
    planes = coarse.planes(lowest, highest)
    noise = max(estimate_noise(level), estimate_noise(level_other))
    costs = sweep_planes(equalised_slopes(level, noise), equalised_slopes(level_other, noise), coarse, planes)
    bend = int(0.3 * WORST)
    total = aggregate(costs, bend, jump_costs(level, int(1.5 * WORST), bend, 10.0))
    plane, place = choose(total)
    inverse_depth = (planes[0] + place * (planes[1] - planes[0])).astype(np.float32)
    sure, _ = agree(plane, backward_planes(total, coarse, planes), coarse.project(inverse_depth))
    sure = cv2.erode(sure.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    if sure.mean() < 0.02:
        return lowest, highest
    return float(np.percentile(inverse_depth[sure], 0.5)), float(np.percentile(inverse_depth[sure], 99.5))
