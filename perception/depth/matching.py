"""One pair of pictures: the depth of the base view by sweep, weak string, check and error surface."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.epipolar import Epipolar
from perception.depth.essd import BaseWindow, Window, epipolar_axes, sample_surface
from perception.depth.inverse_depth import InverseDepth
from perception.depth.membrane import Springs, relax_membrane
from perception.depth.settings import Settings
from perception.depth.sweep_choice import choose_on_affordable_level
from perception.depth.view import View
from perception.depth.voids import fill_voids

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]


NOISE_FLOOR = 0.5
"""No window matches better than this part of the noise; the noise estimate takes some texture for noise."""
LINE_SHARP_PX = 0.2
"""Matches at least this sharp across their line tell how wrong the motion is."""
LINE_THINNING = 3
"""Every third pixel, both ways, is enough to judge the motion by."""
LINE_SLACK = 3.0
"""… when they stray by more than this many of their own standard deviations."""


@dataclass(frozen=True)
class Match:
    """What one pair says: inverse depth with variance, which pixels were confirmed both ways, and from
    how far off (1/m) it may still be the surface that was predicted."""

    measured: InverseDepth
    sure: Mask
    reach: Field


def flatten_steps(disparity: Field, radius: int = 4, step: float = 0.5) -> Field:
    """Smooth the steps between planes and leave the jumps between surfaces.

    Over the window the mean replaces the value as far as the window's variance is below that of a `step`;
    both are averaged over all windows that hold the pixel (He's guided filter with itself as guide).
    """
    side = (2 * radius + 1, 2 * radius + 1)
    mean = cv2.blur(disparity, side)
    variance = np.maximum(cv2.blur(disparity * disparity, side) - mean * mean, 0)
    power = variance * variance
    keep = power / (power + np.float32(step**4))
    return np.asarray(cv2.blur(keep, side) * disparity + cv2.blur((1 - keep) * mean, side), np.float32)


def slant(disparity: Field) -> Field:
    """Steepness of the disparity, pixels per pixel, over 5×5 pixels."""
    across = cv2.Sobel(disparity, cv2.CV_32F, 1, 0, ksize=5, scale=1 / 128)
    down = cv2.Sobel(disparity, cv2.CV_32F, 0, 1, ksize=5, scale=1 / 128)
    return np.hypot(across, down).astype(np.float32)


def jump_height(disparity: Field, radius: int) -> Field:
    """Greatest difference of the disparity within the window, beyond the pixel that a slanted surface may take."""
    window = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    spread = np.asarray(cv2.dilate(disparity, window) - cv2.erode(disparity, window), np.float32)
    return np.maximum(spread - 1, np.float32(0))


def refine(
    base: View, other: View, geometry: Epipolar, inverse_depth: Field, settings: Settings
) -> tuple[Field, Field, Field, Field]:
    """Measure what is left of the disparity on the error surface (2.8) and turn it into inverse depth.

    The minimum is that of the surface with the soft epipolar term λ_ep v² (2.7), λ_ep = s²/σ_ep², and the
    covariance of its place is 2 s² H⁻¹, so that an edge along the motion has no say: what an error across the
    line would do to it is part of its variance.

    Returns:
        The measurement and its variance, NaN where the error surface has no minimum; |C|, the pixels a unit of
        inverse depth is worth; and the variance of the inverse depth that the motion's error makes.
    """
    window = BaseWindow(base.calm, settings.window_radius, settings.equalisation, Window.TENT)
    projection = geometry.project(inverse_depth)
    _, _, worth = epipolar_axes(projection)
    surface = sample_surface(window, other.calm, projection, settings.surface_step)
    floor = np.float32(2 * (NOISE_FLOOR * max(base.noise, other.noise)) ** 2)
    weight: Field = np.maximum(surface.value / (window.pixels - 1), floor)
    weight = weight / np.float32(settings.epipolar_std_px**2)
    shift, _, least = surface.minimum(weight)
    power: Field = np.maximum(least / (window.pixels - 1), floor) * np.float32(settings.noise_factor**2)
    spread, _, _ = surface.covariance(power, weight)
    sample = surface.thinned(LINE_THINNING)
    _, across, _ = sample.minimum()
    _, _, across_variance = sample.covariance(power[::LINE_THINNING, ::LINE_THINNING])
    off_line = np.float32(line_error(across, across_variance) ** 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = (spread + np.float32(settings.bias_px**2) + off_line) / (worth * worth)
        found = (np.abs(shift) <= 0.5) & np.isfinite(variance) & (worth > 1e-6)
        value = inverse_depth + shift / worth
    void = np.float32(np.nan)
    drift = np.asarray(off_line / np.square(np.maximum(worth, np.float32(1e-6))), np.float32)
    return np.where(found, value, void), np.where(found, variance, void), worth, drift


def line_error(across: Field, variance: Field) -> float:
    """How far the matches lie off their epipolar lines beyond their own deviation: the error of the motion, px.

    What the motion's error does across the lines it does along them too, where nothing shows it; so it is
    added to the uncertainty of every match. A short baseline is then believed less than a long one.
    """
    sharp = (variance < LINE_SHARP_PX**2) & np.isfinite(across)
    if np.count_nonzero(sharp) < 100:
        return 0.0
    stray = 1.4826 * float(np.median(np.abs(across[sharp])))
    own = max(LINE_SLACK * float(np.sqrt(np.median(variance[sharp]))), 0.1)
    return float(np.sqrt(max(stray**2 - own**2, 0.0)))


def match_pair(
    base: View,
    other: View,
    geometry: Epipolar,
    lowest: float,
    highest: float,
    predicted: InverseDepth,
    settings: Settings,
) -> Match:
    """Match the base picture with the other one and regularise.

    Args:
        base, other: the two pictures.
        geometry: from the base view to the other.
        lowest, highest: inverse depths between which to search.
        predicted: what is expected of the base view; NaN where nothing is.
    """
    choice = choose_on_affordable_level(base, other, geometry, lowest, highest, predicted, settings)
    kept = np.where(choice.sure, choice.inverse_depth / choice.spacing, np.float32(np.nan))
    slope = geometry.project(choice.inverse_depth)
    level = np.abs(slope.slope_x) >= np.abs(slope.slope_y)
    disparity, spread, reach = fill_voids(kept, choice.hidden, level)
    flat = flatten_steps(disparity)
    fine, fine_variance, worth, drift = refine(base, other, geometry, flat * choice.spacing, settings)

    drift = drift / choice.spacing**2
    blunt = np.square(np.float32(settings.unrefined_px) / np.maximum(worth * choice.spacing, 1e-3)) + drift
    blunt = blunt + np.square(np.float32(settings.vague_px) * choice.lack)
    jump = jump_height(disparity, settings.window_radius)
    refined = choice.sure & np.isfinite(fine) & (jump < 0.5)
    value = np.where(refined, fine / choice.spacing, disparity)
    variance = np.where(refined, fine_variance / choice.spacing**2, blunt)
    variance += np.where(
        refined, np.square(settings.slant_bias * slant(flat)), np.square(settings.jump_part * jump)
    )
    variance += np.square(settings.void_part * spread) + np.square(np.float32(0.1) * reach)

    springs = Springs.cut_at_edges(base.calm, max(base.contrast, base.noise), disparity, settings.tear_px)
    regular = relax_membrane(value, variance, springs, settings.strength, settings.membrane_iterations, value)
    reach = choice.spacing * np.sqrt(np.float32(settings.reach_px**2) + np.float32(settings.gate**2) * drift)
    return Match(
        InverseDepth(
            np.maximum(regular, 0) * choice.spacing,
            (variance * choice.spacing**2).astype(np.float32),
            np.where(choice.sure, np.minimum(choice.cost, np.float32(0.99)), np.float32(1)),
        ),
        choice.sure,
        reach.astype(np.float32),
    )
