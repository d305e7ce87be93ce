"""The discrete part of the match on one level of the pyramid: sweep, scanline aggregation, forward–backward check."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.match.consistency import agree, backward_planes, without_specks
from perception.depth.match.plane_sweep import WORST, admit_prediction, sweep_planes
from perception.depth.match.scanline import adapt_p2, aggregate, blend_costs, choose, pick
from perception.depth.match.view import View
from perception.depth.settings import DepthSettings
from perception.image.bands import Band, join_bands
from perception.image.pyramid import enlarge

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]

AGAIN = 0.75
"""What P1 and P2 are in each of two aggregations, as parts of what they are in one: in the second both are charged."""


@dataclass(frozen=True)
class Choice:
    """What the sweep chose, height × width.

    Inverse depth; its cost in this pair alone, 0 to 1; its ambiguity, 0 to 1; whether the other image confirmed it;
    whether it is rather occluded there than out of view; and the distance of the planes in 1/m.
    """

    inverse_depth: Field
    cost: Field
    ambiguity: Field
    confirmed: Mask
    occluded: Mask
    spacing: np.float32


def choose_planes(
    base: View,
    other: View,
    geometry: Epipolar,
    planes: NDArray[np.float64],
    predicted: InverseDepth,
    settings: DepthSettings,
) -> Choice:
    """Choose a plane for every pixel of the base image."""
    costs = alone = sweep_planes(base.slopes, other.slopes, geometry, planes)
    if np.isfinite(predicted.value).any():
        costs = admit_prediction(alone, planes, predicted, settings.stiffness)
    contrast = max(0.6 * base.contrast, 1.4 * base.noise)
    price = WORST * (AGAIN if base.noisy else 1)
    p1 = int(settings.p1 * price)
    p2 = adapt_p2(base.denoised, int(settings.p2 * price), p1 + p1 // 5, contrast)
    total = aggregate(costs, p1, p2)
    if base.noisy:
        total = aggregate(blend_costs(costs, total, WORST), p1, p2)
    plane, place = choose(total)
    spacing = np.float32(planes[1] - planes[0])
    inverse_depth = np.asarray(np.float32(planes[0]) + place * spacing, np.float32)
    backward = backward_planes(total, geometry, planes)

    def judge(band: Band) -> tuple[Field, Field, Mask]:
        rows = band.inner
        confirmed = agree(plane[rows], backward, *geometry.meet(inverse_depth[rows], rows))
        cost = pick(alone, plane[rows], rows.start).astype(np.float32)
        mean = np.zeros(cost.shape, np.float32)
        for plane_costs in alone[:, rows]:
            cv2.accumulate(plane_costs, mean)
        mean /= np.float32(len(planes))
        ambiguity = np.clip(1 - (mean - cost) / np.float32(settings.distinctness * WORST), 0, 1)
        cost = cost / np.float32(WORST) + np.float32(settings.distinctness) * ambiguity
        return cost, ambiguity, confirmed

    cost, ambiguity, agreed = join_bands(base.shape, judge)
    confirmed = without_specks(agreed, place)
    occluded = ~confirmed
    for end in (planes[0], planes[-1]):
        occluded[occluded] = geometry.in_view(float(end), occluded)
    return Choice(inverse_depth, cost, ambiguity, confirmed, occluded, spacing)


def choose_on_affordable_level(
    base: View,
    other: View,
    geometry: Epipolar,
    lowest: float,
    highest: float,
    predicted: InverseDepth,
    settings: DepthSettings,
) -> Choice:
    """Sweep between two inverse depths on the finest level of the pyramid that `max_hypotheses` allows.

    What a coarser level chose is brought to the finest, where the error surface refines it (section 2.5).
    """
    full = base.shape
    planes = geometry.planes(lowest, highest)
    for _ in range(1, settings.levels):
        if len(planes) * geometry.shape[0] * geometry.shape[1] <= settings.max_hypotheses:
            break
        base, other = base.level(1), other.level(1)
        factor = base.shape[1] / geometry.shape[1]
        geometry = Epipolar(geometry.camera.scaled(factor), geometry.motion, base.shape)
        planes = geometry.planes(lowest, highest)
    if base.shape == full:
        return choose_planes(base, other, geometry, planes, predicted, settings)
    shape = geometry.shape
    small = InverseDepth(
        *(_thin_out(part, shape) for part in (predicted.value, predicted.variance, predicted.cost))
    )
    choice = choose_planes(base, other, geometry, planes, small, settings)
    confirmed, occluded = (
        enlarge(mask.astype(np.float32), full) > 0.5 for mask in (choice.confirmed, choice.occluded)
    )
    inverse_depth, cost, ambiguity = (
        enlarge(part, full) for part in (choice.inverse_depth, choice.cost, choice.ambiguity)
    )
    return Choice(inverse_depth, cost, ambiguity, confirmed, occluded, choice.spacing)


def _thin_out(field: Field, shape: tuple[int, int]) -> Field:
    return np.asarray(cv2.resize(field, (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST), np.float32)
