"""One pair of pictures: the depth of the base view by sweep, weak string, check and error surface."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.bands import Band, join_bands
from perception.depth.contrast import ROUNDING
from perception.depth.epipolar import Epipolar
from perception.depth.essd import BaseWindow, Window, epipolar_axes, sample_surface, step_along
from perception.depth.inverse_depth import InverseDepth
from perception.depth.membrane import Springs, relax_membrane
from perception.depth.outline import HALO as OUTLINE_HALO
from perception.depth.outline import align_outlines
from perception.depth.quantile import median, robust_deviation
from perception.depth.select import select
from perception.depth.settings import Settings
from perception.depth.sweep_choice import choose_on_affordable_level
from perception.depth.view import View
from perception.depth.voids import fill_voids

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]


FLAT_RADIUS = 4
"""Half the window, in pixels, over which the steps between planes are smoothed."""
LINE_SHARP_PX = 0.2
"""Matches at least this sharp across their line tell how wrong the motion is."""
LINE_THINNING = 3
"""Every third pixel, both ways, is enough to judge the motion by."""
LINE_SLACK = 1.2
"""… when they stray by more than this many of their own standard deviations."""


@dataclass(frozen=True)
class Match:
    """What one pair says: inverse depth with variance, which pixels were confirmed both ways, from how far
    off (1/m) it may still be the surface that was predicted, which part of the variance the next pair repeats, and
    which pixels were measured on the error surface, so that noise is what else they err by."""

    measured: InverseDepth
    sure: Mask
    reach: Field
    repeated: Field
    refined: Mask


def flatten_steps(disparity: Field, radius: int = FLAT_RADIUS, step: float = 0.5) -> Field:
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


def flatten_whole(disparity: Field) -> Field:
    """`flatten_steps` of a whole map, in bands."""
    shape = disparity.shape[0], disparity.shape[1]
    (flat,) = join_bands(
        shape, lambda band: (flatten_steps(disparity[band.outer])[band.trim],), 2 * FLAT_RADIUS
    )
    return flat


def jump_height(disparity: Field, radius: int) -> Field:
    """Greatest difference of the disparity within the window, beyond the pixel that a slanted surface may take."""
    window = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    spread = np.asarray(cv2.dilate(disparity, window) - cv2.erode(disparity, window), np.float32)
    return np.maximum(spread - 1, np.float32(0))


def bend(disparity: Field, radius: int) -> Field:
    """How far the surface at a pixel departs from the planes through what stands `radius` to both sides of it."""
    middle = disparity[radius:-radius, radius:-radius]
    across = disparity[radius:-radius, : -2 * radius] + disparity[radius:-radius, 2 * radius :]
    down = disparity[: -2 * radius, radius:-radius] + disparity[2 * radius :, radius:-radius]
    inner = np.sqrt(np.square(across / 2 - middle) + np.square(down / 2 - middle))
    return np.pad(inner, radius, mode="edge").astype(np.float32)


@dataclass(frozen=True)
class Refinement:
    """What the error surfaces say, height × width: the disparity from which they were sampled, in planes; the rest
    of it and its variance, px and px², NaN and ∞ where a surface has no minimum; |C|, the pixels a unit of inverse
    depth is worth; and the variance, px², that the motion's error adds everywhere."""

    start: Field
    shift: Field
    variance: Field
    worth: Field
    off_line: np.float32

    def disparity(self, rows: slice, spacing: np.float32) -> tuple[Field, Field]:
        """The refined disparity of some rows and its variance, in planes; NaN is a void."""
        shift, worth = self.shift[rows], self.worth[rows] * spacing
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = (self.variance[rows] + self.off_line) / (worth * worth)
            found = (np.abs(shift) <= 0.5) & np.isfinite(variance) & (worth > 1e-6 * spacing)
            value = self.start[rows] + shift / worth
        return select(found, value, np.nan), select(found, variance, np.nan)


def refine(
    base: View,
    other: View,
    geometry: Epipolar,
    disparity: Field,
    spacing: np.float32,
    settings: Settings,
    motion_error_px: float = 0.0,
) -> Refinement:
    """Measure what is left of the disparity on the error surface (2.8).

    The minimum is that of the surface with the soft epipolar term λ_ep v² (2.7), λ_ep = s²/σ_ep², and the
    covariance of its place is 2 s² H⁻¹, so that an edge along the motion has no say: what an error across the
    line would do to it is part of its variance. A rough step along the line comes first, for the expansion holds
    close to the minimum and the windows must follow the slant.

    Args:
        disparity: where to begin, in planes `spacing` 1/m apart; what is found is within half a pixel of it.
    """
    floor, gain = np.float32(ROUNDING), np.float32(base.noise_weight)
    soft, between = base.soft, other.between
    height, width = base.shape
    thin = (-(-height // LINE_THINNING), -(-width // LINE_THINNING))
    across, across_variance = np.empty(thin, np.float32), np.empty(thin, np.float32)

    def look(band: Band) -> tuple[Field, ...]:
        rows = band.inner
        window = BaseWindow(soft[band.outer], settings.window_radius, settings.equalisation, Window.TENT)
        projection = geometry.project(disparity[band.outer] * spacing, band.outer)
        shift = step_along(window, between, projection)[band.trim]
        worth = np.sqrt(np.square(projection.slope_x) + np.square(projection.slope_y))[band.trim] * spacing
        with np.errstate(divide="ignore", invalid="ignore"):
            found = (np.abs(shift) <= 0.5) & (worth > 1e-6 * spacing)
            return (select(found, disparity[rows] + shift / worth, disparity[rows]),)

    def measure(band: Band) -> tuple[Field, ...]:
        window = BaseWindow(soft[band.outer], settings.window_radius, settings.equalisation, Window.TENT)
        projection = geometry.project(start[band.outer] * spacing, band.outer)
        surface = sample_surface(window, between, projection).rows(band.trim)
        _, _, worth = epipolar_axes(projection)
        weight: Field = np.maximum(surface.value / (window.pixels - 1), floor)
        weight = weight / np.float32(settings.epipolar_std_px**2)
        shift, _, least = surface.minimum(weight)
        power: Field = np.maximum(least / (window.pixels - 1), floor) * gain
        spread, _, _ = surface.covariance(power, weight)
        some = surface.thinned(LINE_THINNING)
        rows = slice(band.inner.start // LINE_THINNING, -(-band.inner.stop // LINE_THINNING))
        _, across[rows], _ = some.minimum()
        _, _, across_variance[rows] = some.covariance(power[::LINE_THINNING, ::LINE_THINNING])
        return shift, spread, worth[band.trim]

    (first,) = join_bands(base.shape, look, settings.window_radius)
    start = flatten_whole(first)
    shift, spread, worth = join_bands(base.shape, measure, settings.window_radius)
    off_line = np.float32(line_error(across, across_variance) ** 2 + motion_error_px**2)
    return Refinement(start, shift, spread, worth, off_line)


def line_error(across: Field, variance: Field) -> float:
    """How far the matches lie off their epipolar lines beyond their own deviation: the error of the motion, px.

    What the motion's error does across the lines it does along them too, where nothing shows it; so it is
    added to the uncertainty of every match. A short baseline is then believed less than a long one.
    """
    sharp = (variance < LINE_SHARP_PX**2) & np.isfinite(across)
    if np.count_nonzero(sharp) < 100:
        return 0.0
    stray = robust_deviation(across[sharp])
    own = max(LINE_SLACK * float(np.sqrt(median(variance[sharp]))), 0.1)
    return float(np.sqrt(max(stray**2 - own**2, 0.0)))


def match_pair(
    base: View,
    other: View,
    geometry: Epipolar,
    lowest: float,
    highest: float,
    predicted: InverseDepth,
    settings: Settings,
    motion_error_px: float = 0.0,
) -> Match:
    """Match the base picture with the other one and regularise.

    Args:
        base, other: the two pictures.
        geometry: from the base view to the other.
        lowest, highest: inverse depths between which to search.
        predicted: what is expected of the base view; NaN where nothing is.
        motion_error_px: by how much the motion is expected to shift a match along its line.
    """
    choice = choose_on_affordable_level(base, other, geometry, lowest, highest, predicted, settings)
    kept = select(choice.sure, choice.inverse_depth / choice.spacing, np.nan)
    level = ~choice.sure
    slope = geometry.project(choice.inverse_depth[level], level)
    level[level] = np.abs(slope.slope_x) >= np.abs(slope.slope_y)
    filled, spread, far_off = fill_voids(kept, choice.hidden, level)
    shape, guide = base.shape, base.bare
    (disparity,) = join_bands(
        shape,
        lambda band: (align_outlines(filled[band.outer], guide[band.outer], base.noise)[band.trim],),
        OUTLINE_HALO,
    )
    flat = flatten_whole(disparity)
    refinement = refine(base, other, geometry, flat, choice.spacing, settings, motion_error_px)
    # The membrane hands on by two rows an iteration what the windows of the jumps have gathered; an even halo keeps
    # the squares of the chess-board.
    halo = 2 * settings.membrane_iterations + settings.window_radius + settings.window_radius % 2
    contrast = max(base.contrast, base.noise)

    def settle(band: Band) -> tuple[NDArray[Any], ...]:
        rows = band.outer
        fine, fine_variance = refinement.disparity(rows, choice.spacing)
        worth = refinement.worth[rows]
        drift = refinement.off_line / np.square(np.maximum(worth, np.float32(1e-6))) / choice.spacing**2
        blunt = (
            np.square(np.float32(settings.unrefined_px) / np.maximum(worth * choice.spacing, 1e-3)) + drift
        )
        blunt = blunt + np.square(np.float32(settings.vague_px) * choice.lack[rows])
        jump = jump_height(disparity[rows], settings.window_radius)
        refined = choice.sure[rows] & np.isfinite(fine) & (jump < 0.5)
        value = select(refined, fine, disparity[rows])
        variance = select(refined, fine_variance, blunt)
        bent = np.square(
            np.float32(settings.bend_part) * bend(refinement.start[rows], settings.window_radius)
        )
        variance += select(refined, bent, np.square(settings.jump_part * jump))
        variance += np.square(settings.void_part * spread[rows]) + np.square(np.float32(0.1) * far_off[rows])

        springs = Springs.cut_at_edges(guide[rows], contrast, disparity[rows], settings.tear_px)
        regular = relax_membrane(
            value, variance, springs, settings.strength, settings.membrane_iterations, value
        )
        reach = choice.spacing * np.sqrt(
            np.float32(settings.reach_px**2) + np.float32(settings.gate**2) * drift
        )
        cost = select(choice.sure[rows], np.minimum(choice.cost[rows], np.float32(0.99)), 1)
        repeated = select(refined, np.float32(settings.repeated_part) * variance + bent, 0)
        square = choice.spacing**2
        settled = (
            np.maximum(regular, 0) * choice.spacing,
            variance * square,
            cost,
            reach,
            repeated * square,
            refined,
        )
        return tuple(part[band.trim] for part in settled)

    value, variance, cost, reach, repeated, refined = join_bands(shape, settle, halo)
    return Match(InverseDepth(value, variance, cost), choice.sure, reach, repeated, refined)
