"""The discrete part of the match: sweep, weak string and forward–backward check on one level of the pyramid."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.consistency import agree, backward_planes
from perception.depth.contrast import equalised_slopes, estimate_noise, smooth_against_noise
from perception.depth.epipolar import Epipolar
from perception.depth.inverse_depth import InverseDepth
from perception.depth.pyramid import build_pyramid, enlarge
from perception.depth.scanline import aggregate, choose, jump_costs
from perception.depth.settings import Settings
from perception.depth.sweep import WORST, admit_prediction, sweep_planes

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Choice:
    """What the sweep chose, height × width.

    Inverse depth; its cost in this pair alone, 0 to 1; whether the other picture confirmed it; whether it is
    rather hidden there than out of view; and the distance of the planes in 1/m.
    """

    inverse_depth: Field
    cost: Field
    sure: Mask
    hidden: Mask
    spacing: np.float32


def choose_planes(
    base: Field,
    other: Field,
    geometry: Epipolar,
    planes: NDArray[np.float64],
    predicted: InverseDepth,
    settings: Settings,
) -> Choice:
    """Choose a plane for every pixel of the base picture."""
    noise = max(estimate_noise(base), estimate_noise(other))
    calm, calm_other = smooth_against_noise(base, noise), smooth_against_noise(other, noise)
    costs = sweep_planes(
        equalised_slopes(calm, noise),
        equalised_slopes(calm_other, noise),
        geometry,
        planes,
    )
    alone = costs
    if np.isfinite(predicted.value).any():
        alone = costs.copy()
        admit_prediction(costs, planes, predicted, settings.stiffness)
    contrast = max(0.7 * float(np.sqrt(np.mean(np.square(np.diff(calm, axis=1))))), 2 * noise)
    bend = int(settings.bend * WORST)
    total = aggregate(costs, bend, jump_costs(calm, int(settings.jump * WORST), bend + bend // 5, contrast))
    plane, place = choose(total)
    spacing = np.float32(planes[1] - planes[0])
    inverse_depth = np.asarray(np.float32(planes[0]) + place * spacing, np.float32)
    sure = agree(plane, backward_planes(total, geometry, planes), geometry.project(inverse_depth))
    reachable = np.ones(base.shape, bool)
    for end in (planes[0], planes[-1]):
        reachable &= geometry.in_view(geometry.project(float(end)))
    cost = np.take_along_axis(alone, plane[:, None, :], axis=1)[:, 0].astype(np.float32) / np.float32(WORST)
    return Choice(inverse_depth, cost, sure, ~sure & reachable, spacing)


def choose_on_affordable_level(
    base: Field,
    other: Field,
    geometry: Epipolar,
    lowest: float,
    highest: float,
    predicted: InverseDepth,
    settings: Settings,
) -> Choice:
    """Sweep between two inverse depths on the finest level of the pyramid that `max_hypotheses` allows.

    What a coarser level chose is brought to the finest, where the error surface refines it (section 2.5).
    """
    planes = geometry.planes(lowest, highest)
    levels, levels_other = build_pyramid(base, settings.levels), build_pyramid(other, settings.levels)
    level = 0
    while level + 1 < len(levels) and len(planes) * levels[level].size > settings.max_hypotheses:
        level += 1
        shape = (levels[level].shape[0], levels[level].shape[1])
        geometry = Epipolar(geometry.camera.scaled(shape[1] / geometry.shape[1]), geometry.motion, shape)
        planes = geometry.planes(lowest, highest)
    if level == 0:
        return choose_planes(base, other, geometry, planes, predicted, settings)
    shape = geometry.shape
    small = InverseDepth(
        *(_thin_out(part, shape) for part in (predicted.value, predicted.variance, predicted.cost))
    )
    choice = choose_planes(levels[level], levels_other[level], geometry, planes, small, settings)
    full = (base.shape[0], base.shape[1])
    sure, hidden = (enlarge(mask.astype(np.float32), full) > 0.5 for mask in (choice.sure, choice.hidden))
    return Choice(
        enlarge(choice.inverse_depth, full), enlarge(choice.cost, full), sure, hidden, choice.spacing
    )


def _thin_out(field: Field, shape: tuple[int, int]) -> Field:
    return np.asarray(cv2.resize(field, (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST), np.float32)
