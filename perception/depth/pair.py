"""One pair of images: the depth of the base view by sweep, scanline aggregation, check and error surface."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.match.plane_choice import choose_on_affordable_level
from perception.depth.match.view import View
from perception.depth.refine.flatten import flatten_whole
from perception.depth.refine.holes import fill_holes
from perception.depth.refine.membrane import Springs, relax_membrane
from perception.depth.refine.outline import HALO as OUTLINE_HALO
from perception.depth.refine.outline import align_outlines
from perception.depth.refine.refinement import refine
from perception.depth.settings import DepthSettings
from perception.image.bands import Band, join_bands
from perception.image.select import select

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Match:
    """What one pair measures, height × width: inverse depth with variance; which pixels were confirmed both ways; from
    how far off (1/m) it may still be the surface that was predicted; which part of the variance, (1/m)², the next pair
    repeats; and which pixels were measured on the error surface, so that the rest of their error is noise."""

    measured: InverseDepth
    confirmed: Mask
    reach: Field
    repeated: Field
    refined: Mask

    @classmethod
    def unconfirmed(cls, shape: tuple[int, int]) -> "Match":
        """A pair of which nothing was confirmed."""
        none, zero = np.zeros(shape, bool), np.zeros(shape, np.float32)
        return cls(InverseDepth.unknown(shape), none, zero, zero, none)


def step_height(disparity: Field, radius: int) -> Field:
    """Greatest step between neighbours within the window, beyond the pixel by which planes or a slant may differ."""
    step = np.zeros_like(disparity)
    right, down = np.abs(np.diff(disparity, axis=1)), np.abs(np.diff(disparity, axis=0))
    for side in (step[:, 1:], step[:, :-1]):
        np.maximum(side, right, out=side)
    for side in (step[1:], step[:-1]):
        np.maximum(side, down, out=side)
    window = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    return np.maximum(np.asarray(cv2.dilate(step, window), np.float32) - 1, np.float32(0))


def curvature(disparity: Field, radius: int) -> Field:
    """How far the surface at a pixel departs from the planes through its neighbours at `radius` to both sides."""
    middle = disparity[radius:-radius, radius:-radius]
    across = disparity[radius:-radius, : -2 * radius] + disparity[radius:-radius, 2 * radius :]
    down = disparity[: -2 * radius, radius:-radius] + disparity[2 * radius :, radius:-radius]
    inner = np.sqrt(np.square(across / 2 - middle) + np.square(down / 2 - middle))
    whole = cv2.copyMakeBorder(inner, radius, radius, radius, radius, cv2.BORDER_REPLICATE)
    return np.asarray(whole, np.float32)


def match_pair(
    base: View,
    other: View,
    geometry: Epipolar,
    lowest: float,
    highest: float,
    predicted: InverseDepth,
    settings: DepthSettings,
    motion_error_px: float = 0.0,
) -> Match:
    """Match the base image with the other one and regularise.

    Args:
        base, other: the two images.
        geometry: from the base view to the other.
        lowest, highest: inverse depths between which to search, 1/m.
        predicted: what is expected of the base view; NaN where nothing is.
        motion_error_px: by how much the motion's error is expected to shift a match along its line.
    """
    choice = choose_on_affordable_level(base, other, geometry, lowest, highest, predicted, settings)
    if not choice.confirmed.any():
        return Match.unconfirmed(base.shape)
    kept = select(choice.confirmed, choice.inverse_depth / choice.spacing, np.nan)
    level = ~choice.confirmed
    slope = geometry.project(choice.inverse_depth[level], level)
    level[level] = np.abs(slope.slope_x) >= np.abs(slope.slope_y)
    filled, spread, far_off = fill_holes(kept, choice.occluded, level)
    shape, guide = base.shape, base.denoised
    (disparity,) = join_bands(
        shape,
        lambda band: (align_outlines(filled[band.outer], guide[band.outer], base.noise)[band.trim],),
        OUTLINE_HALO,
    )
    flat = flatten_whole(disparity)
    refinement = refine(base, other, geometry, flat, choice.spacing, settings, motion_error_px)
    # The membrane hands on by two rows an iteration what the windows of the steps have gathered; an even halo keeps
    # the squares of the chess-board.
    halo = 2 * settings.membrane_iterations + settings.window_radius + settings.window_radius % 2
    contrast = max(base.contrast, base.noise)

    def settle(band: Band) -> tuple[NDArray[Any], ...]:
        rows = band.outer
        fine, fine_variance = refinement.disparity(rows, choice.spacing)
        sensitivity = refinement.sensitivity[rows]
        drift = refinement.off_line / np.square(np.maximum(sensitivity, np.float32(1e-6))) / choice.spacing**2
        blunt = (
            np.square(np.float32(settings.unrefined_px) / np.maximum(sensitivity * choice.spacing, 1e-3))
            + drift
        )
        blunt = blunt + np.square(np.float32(settings.ambiguous_px) * choice.ambiguity[rows])
        step = step_height(disparity[rows], settings.window_radius)
        refined = choice.confirmed[rows] & np.isfinite(fine) & (step < 0.5)
        value = select(refined, fine, disparity[rows])
        variance = select(refined, fine_variance, blunt)
        curved = np.square(
            np.float32(settings.curvature_part) * curvature(refinement.start[rows], settings.window_radius)
        )
        variance += select(refined, curved, np.square(settings.step_part * step))
        variance += np.square(settings.hole_part * spread[rows]) + np.square(np.float32(0.1) * far_off[rows])

        springs = Springs.cut_at_edges(guide[rows], contrast, disparity[rows], settings.tear_px)
        regular = relax_membrane(
            value, variance, springs, settings.strength, settings.membrane_iterations, value
        )
        reach = choice.spacing * np.sqrt(
            np.float32(settings.reach_px**2) + np.float32(settings.gate**2) * drift
        )
        cost = select(choice.confirmed[rows], np.minimum(choice.cost[rows], np.float32(0.99)), 1)
        # What four springs lend a pixel of its neighbours they lend again in the next pair.
        lent = variance / (variance + np.float32(settings.strength / 4))
        repeated = select(refined, (lent + np.float32(settings.repeated_part)) * variance + curved, 0)
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
    return Match(InverseDepth(value, variance, cost), choice.confirmed, reach, repeated, refined)
