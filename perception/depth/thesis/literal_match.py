"""The match of chapter 2 to the letter: a search in two dimensions, level by level (sections 2.3–2.5).

On the coarsest level the error ESSD (2.7), (2.8) is computed for all whole displacements of a region around
the predicted one, on the finer levels for those next to what the level before found. Two parabolas give the
place below the pixel and its variance, and the membrane regularises both components.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Epipolar, Projection
from perception.depth.refine.essd import BaseWindow
from perception.depth.refine.membrane import Springs, relax_membrane, relaxed_variance
from perception.depth.refine.parabola import disparity_variance, fit_parabola
from perception.depth.settings import DepthSettings
from perception.image.pyramid import build_pyramid, enlarge
from perception.image.quantile import quantiles

Field = NDArray[np.float32]
WIDEST_SEARCH = 10
"""Greatest half side of the region searched on the coarsest level, pixels."""
LEAST_VARIANCE = 1e-4


@dataclass(frozen=True)
class Displacements:
    """Where every base pixel goes in the other image, relative to the predicted place, with its variances."""

    u: Field
    v: Field
    variance_u: Field
    variance_v: Field


def match_literally(
    base: Field, other: Field, geometry: Epipolar, predicted: InverseDepth, settings: DepthSettings
) -> InverseDepth:
    """Inverse depth measured by one pair, (2.22): ρ = ρ̂ + cᵀQ⁻¹(d − d̂)/cᵀQ⁻¹c with variance 1/cᵀQ⁻¹c.

    Args:
        base, other: grey images, height × width.
        geometry: from the base view to the other.
        predicted: where the search begins; known at every pixel.
    """
    levels, levels_other = build_pyramid(base, settings.levels), build_pyramid(other, settings.levels)
    found: Displacements | None = None
    for level in range(len(levels) - 1, -1, -1):
        shape = (levels[level].shape[0], levels[level].shape[1])
        here = Epipolar(geometry.camera.scaled(shape[1] / base.shape[1]), geometry.motion, shape)
        rho = _resized(predicted.value, shape)
        projection = here.project(rho)
        if found is None:
            zero = np.zeros(shape, np.float32)
            reach = _reach(here, projection, settings)
            found = _search(levels[level], levels_other[level], projection, zero, zero, reach, settings)
        else:
            u, v = enlarge(2 * found.u, shape), enlarge(2 * found.v, shape)
            found = _search(levels[level], levels_other[level], projection, u, v, 1, settings)
    assert found is not None
    projection = geometry.project(predicted.value)
    with np.errstate(divide="ignore", invalid="ignore"):
        weight_u, weight_v = projection.slope_x / found.variance_u, projection.slope_y / found.variance_v
        information = weight_u * projection.slope_x + weight_v * projection.slope_y
        value = predicted.value + (weight_u * found.u + weight_v * found.v) / information
    known = information > 0
    unknown = np.float32(np.nan)
    return InverseDepth(
        np.where(known, np.maximum(value, 1e-6), unknown).astype(np.float32),
        np.where(known, 1 / information, unknown).astype(np.float32),
        np.zeros(base.shape, np.float32),
    )


def _reach(geometry: Epipolar, predicted: Projection, settings: DepthSettings) -> int:
    """Half the side of the region that holds all depths between `near` and `far`."""
    widest = 1.0
    for rho in (1 / settings.near, 1 / settings.far):
        end = geometry.project(rho)
        distance = np.maximum(np.abs(end.x - predicted.x), np.abs(end.y - predicted.y))
        ahead = distance[np.isfinite(distance)]
        if ahead.size:
            widest = max(widest, *quantiles(ahead, 0.95))
    return int(min(np.ceil(widest), WIDEST_SEARCH))


def _search(
    base: Field, other: Field, projection: Projection, u: Field, v: Field, reach: int, settings: DepthSettings
) -> Displacements:
    """Whole displacements around (u, v), two parabolas at the best, and the membrane; ESSD (2.7), (2.8)."""
    window = BaseWindow(base, settings.window_radius)
    along_x, along_y, _ = projection.line

    def essd(du: Field, dv: Field) -> Field:
        warped = cv2.remap(
            other, projection.x + du, projection.y + dv, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        off_line = du * along_y - dv * along_x
        cost = window.sum_of_squares(np.asarray(warped, np.float32), settings.equalisation)
        return np.asarray(cost + np.float32(settings.epipolar_weight) * off_line * off_line, np.float32)

    best = np.full(base.shape, np.inf, np.float32)
    best_i, best_j = np.zeros(base.shape, np.float32), np.zeros(base.shape, np.float32)
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            cost = essd(u + np.float32(i), v + np.float32(j))
            better = cost < best
            best[better], best_i[better], best_j[better] = cost[better], i, j
    u, v = u + best_i, v + best_j
    one = np.float32(1)
    offset_u, curve_u, least_u = fit_parabola(essd(u - one, v), best, essd(u + one, v))
    offset_v, curve_v, least_v = fit_parabola(essd(u, v - one), best, essd(u, v + one))
    variance_u = np.maximum(disparity_variance(least_u, curve_u, window.pixels), LEAST_VARIANCE)
    variance_v = np.maximum(disparity_variance(least_v, curve_v, window.pixels), LEAST_VARIANCE)
    springs = Springs.even((base.shape[0], base.shape[1]))
    strength, iterations = settings.strength, settings.membrane_iterations
    smooth_u = relax_membrane(u + offset_u, variance_u, springs, strength, iterations, u)
    smooth_v = relax_membrane(v + offset_v, variance_v, springs, strength, iterations, v)
    spread_u = relaxed_variance(u + offset_u, variance_u, springs, strength)
    spread_v = relaxed_variance(v + offset_v, variance_v, springs, strength)
    return Displacements(smooth_u, smooth_v, spread_u, spread_v)


def _resized(field: Field, shape: tuple[int, int]) -> Field:
    if field.shape == shape:
        return field
    return np.asarray(cv2.resize(field, (shape[1], shape[0]), interpolation=cv2.INTER_AREA), np.float32)
