"""One pair of pictures: the depth of the base view by sweep, weak string, check and error surface."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.consistency import agree, backward_planes
from perception.depth.contrast import equalised_slopes, estimate_noise, smooth_against_noise
from perception.depth.epipolar import Epipolar
from perception.depth.essd import BaseWindow, epipolar_axes, sample_surface
from perception.depth.inverse_depth import InverseDepth
from perception.depth.membrane import Springs, relax_membrane
from perception.depth.scanline import aggregate, choose, jump_costs
from perception.depth.settings import Settings
from perception.depth.sweep import WORST, add_prediction, sweep_planes
from perception.depth.voids import fill_voids

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Match:
    """What one pair says: inverse depth with variance, which pixels were confirmed both ways, which were in view."""

    measured: InverseDepth
    sure: Mask
    in_view: Mask


@dataclass(frozen=True)
class Coarse:
    """The choice of the sweep: inverse depth, confirmed, in view, and the distance of its planes in 1/m."""

    inverse_depth: Field
    sure: Mask
    in_view: Mask
    spacing: float


def sweep(
    base: Field,
    other: Field,
    geometry: Epipolar,
    lowest: float,
    highest: float,
    predicted: InverseDepth,
    settings: Settings,
) -> Coarse:
    """Choose among planes between two inverse depths, with the weak string and the forward–backward check."""
    noise = max(estimate_noise(base), estimate_noise(other))
    calm, calm_other = smooth_against_noise(base, noise), smooth_against_noise(other, noise)
    planes = geometry.planes(lowest, highest)
    costs = sweep_planes(
        equalised_slopes(calm, noise), equalised_slopes(calm_other, noise), geometry, planes, settings.sweep_radius
    )
    if np.isfinite(predicted.value).any():
        add_prediction(
            costs, planes, predicted.value, predicted.variance, settings.prediction_weight, settings.prediction_limit
        )
    contrast = max(0.7 * float(np.sqrt(np.mean(np.square(np.diff(calm, axis=1))))), 2 * noise)
    bend = int(settings.bend * WORST)
    jumps = jump_costs(calm, int(settings.jump * WORST), bend + bend // 5, contrast)
    total = aggregate(costs, bend, jumps)
    plane, place = choose(total)
    spacing = float(planes[1] - planes[0])
    inverse_depth = (np.float32(planes[0]) + place * np.float32(spacing)).astype(np.float32)
    sure, in_view = agree(plane, backward_planes(total, geometry, planes), geometry.project(inverse_depth))
    return Coarse(inverse_depth, sure, in_view, spacing)


def refine(
    base: Field, other: Field, geometry: Epipolar, inverse_depth: Field, settings: Settings, noise: float
) -> tuple[InverseDepth, Field]:
    """Measure what is left of the disparity on the error surface (2.8) and turn it into inverse depth.

    The measurement d = (û, v̂) has the covariance Q of the error surface, to which the soft epipolar term
    adds σ_ep² across the line. With the vector c = (|C|, 0) it gives ρ = ρ₀ + cᵀQ⁻¹d/cᵀQ⁻¹c and
    the variance 1/cᵀQ⁻¹c: an edge along the motion has no say.

    Returns:
        The measurement and |C|, the pixels a unit of inverse depth is worth.
    """
    window = BaseWindow(base, settings.window_radius, settings.equalisation)
    projection = geometry.project(inverse_depth)
    _, _, worth = epipolar_axes(projection)
    surface = sample_surface(window, other, projection, settings.surface_step)
    pixels = window.pixels
    power = np.maximum(surface.least / (pixels - 1), np.float32(2 * noise**2))
    uu, uv, vv = surface.covariance(power * np.float32(settings.noise_factor**2))
    uu = uu + np.float32(settings.bias_px**2)
    vv = vv + np.float32(settings.bias_px**2 + settings.epipolar_std_px**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        # (Q⁻¹ c)/(cᵀ Q⁻¹ c) = (1, −uv/vv)/|C|
        shift = surface.u - uv / vv * surface.v
        variance = (uu - uv * uv / vv) / (worth * worth)
        found = (np.abs(shift) <= 1.5) & (np.abs(surface.v) <= 1.5) & np.isfinite(variance) & (worth > 1e-6)
        value = inverse_depth + shift / worth
    void = np.float32(np.nan)
    return InverseDepth(np.where(found, value, void), np.where(found, variance, void)), worth


def match_pair(
    base: Field,
    other: Field,
    geometry: Epipolar,
    lowest: float,
    highest: float,
    predicted: InverseDepth,
    settings: Settings,
) -> Match:
    """Match the base picture with the other one and regularise.

    Args:
        base, other: grey pictures, height × width, grey levels.
        geometry: from the base view to the other.
        lowest, highest: inverse depths between which to search.
        predicted: what is expected of the base view; NaN where nothing is.
    """
    coarse = sweep(base, other, geometry, lowest, highest, predicted, settings)
    noise = max(estimate_noise(base), estimate_noise(other))
    kept = np.where(coarse.sure, coarse.inverse_depth, np.float32(np.nan))
    filled, spread = fill_voids(kept)
    spacing = np.float32(coarse.spacing)
    guide = cv2.GaussianBlur(base, (0, 0), 0.7)
    contrast = max(float(np.sqrt(np.mean(np.square(np.diff(guide, axis=1))))), noise)
    springs = Springs.cut_at_edges(np.asarray(guide, np.float32), contrast, filled / spacing, 1.5)
    smooth, _ = relax_membrane(
        filled / spacing, np.full_like(filled, 0.3), springs, 1.0, settings.membrane_iterations, filled / spacing
    )
    start = smooth * spacing
    fine, _ = refine(base, other, geometry, start, settings, noise)
    measured = np.isfinite(fine.value) & coarse.sure
    value = np.where(measured, fine.value, start) / spacing
    guess = np.square(spread / spacing * 0.5) + np.float32(0.5)
    variance = np.where(measured, fine.variance / spacing**2, guess)
    regular, _ = relax_membrane(value, variance, springs, settings.strength * 4, settings.membrane_iterations, value)
    return Match(
        InverseDepth(np.maximum(regular, 0) * spacing, variance * spacing**2), measured, coarse.in_view
    )
