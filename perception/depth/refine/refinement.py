"""What is left of the disparity below the pixel, measured on the error surface, and its variance."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.geometry.epipolar import Epipolar
from perception.depth.match.contrast import soften
from perception.depth.match.view import View
from perception.depth.refine.essd import BaseWindow, Window, noise_power, sample_surface
from perception.depth.refine.flatten import flatten_whole
from perception.depth.settings import DepthSettings
from perception.image.bands import Band, bands, join_bands, share
from perception.image.interpolation import InterpolatedImage
from perception.image.quantile import known_median, median, robust_deviation
from perception.image.select import select

Field = NDArray[np.float32]

FIRST_THINNING = 2
"""Every second pixel, both ways, is enough for the first step, as the windows overlap."""
LINE_THINNING = 3
"""Every third pixel, both ways, is enough to judge the motion and the noise by."""
LINE_SHARP_PX = 0.2
"""Matches at least this sharp across their line show how wrong the motion is."""
LINE_SLACK = 1.2
"""… when their epipolar residuals exceed this many of their own standard deviations."""
SAME_SCALE = 0.003
"""Views whose scales differ by less than this part are softened alike."""
TYPICAL_PART = 1 / 3
"""By this part a window with less noise than the median is taken up to it: few pixels may show little by chance."""


@dataclass(frozen=True)
class Refinement:
    """What the error surfaces give, height × width: the disparity from which they were sampled, in planes; the rest
    of it and its variance, px and px², NaN and ∞ where a surface has no minimum; the sensitivity |C|, pixels per 1/m;
    and the variance, px², that the motion's error adds everywhere."""

    start: Field
    shift: Field
    variance: Field
    sensitivity: Field
    off_line: np.float32

    def disparity(self, rows: slice, spacing: np.float32) -> tuple[Field, Field]:
        """The refined disparity of some rows and its variance, in planes; NaN is a hole."""
        shift, sensitivity = self.shift[rows], self.sensitivity[rows] * spacing
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            variance = (self.variance[rows] + self.off_line) / (sensitivity * sensitivity)
            found = (np.abs(shift) <= 0.5) & np.isfinite(variance) & (sensitivity > 1e-6 * spacing)
            value = self.start[rows] + shift / sensitivity
        return select(found, value, np.nan), select(found, variance, np.nan)


def refine(
    base: View,
    other: View,
    geometry: Epipolar,
    disparity: Field,
    spacing: np.float32,
    settings: DepthSettings,
    motion_error_px: float = 0.0,
) -> Refinement:
    """Measure what is left of the disparity on the error surface (2.8).

    The minimum is that of the surface with the soft epipolar term λ_ep v² (2.7), λ_ep = s²/σ_ep², and the
    covariance of its place is 2 s² H⁻¹, so that an edge along the motion has no weight: what an error across the
    line would do to it is part of its variance. A step on fewer pixels comes first, for the expansion holds close
    to the minimum and the windows must follow the slant.

    Args:
        disparity: where to begin, in planes `spacing` 1/m apart; what is found is within half a pixel of it.
    """
    across, across_spread = (np.empty_like(disparity[::LINE_THINNING, ::LINE_THINNING]) for _ in range(2))
    soft, interpolated = _of_one_scale(base, other, geometry, median(disparity[::4, ::4]) * float(spacing))
    first = disparity + _first_step(soft, interpolated, geometry, disparity, spacing, settings)
    start = flatten_whole(first)

    def measure(band: Band) -> tuple[Field, ...]:
        window = BaseWindow(soft[band.outer], settings.window_radius, Window.TENT)
        projection = geometry.project(start[band.outer] * spacing, band.outer)
        surface = sample_surface(window, interpolated, projection).rows(band.trim)
        weight = line_weight(surface.value, window, settings)
        shift, _, least = surface.minimum(weight)
        spread, _, _ = surface.covariance(1.0, weight)
        some = surface.thinned(LINE_THINNING)
        rows = _thin_rows(band.inner, LINE_THINNING)
        _, across[rows], _ = some.minimum()
        _, _, across_spread[rows] = some.covariance(1.0)
        return shift, spread, noise_power(least, window), projection.line[2][band.trim]

    shift, spread, power, sensitivity = join_bands(base.shape, measure, settings.window_radius)
    typical = np.float32(known_median(power[::LINE_THINNING, ::LINE_THINNING]))
    power += np.float32(TYPICAL_PART) * np.maximum(typical - power, 0)
    power *= np.float32(base.noise_weight)
    residual = line_error(across, across_spread * power[::LINE_THINNING, ::LINE_THINNING])
    return Refinement(start, shift, spread * power, sensitivity, np.float32(residual**2 + motion_error_px**2))


def _of_one_scale(
    base: View, other: View, geometry: Epipolar, inverse_depth: float
) -> tuple[Field, InterpolatedImage]:
    """The two images, softened so that they are alike where the other one shows the same things larger.

    A blur of variance σ² in each would be one of σ²s² and of σ² on the scale of the other one, and what they differ by
    repeats from pair to pair. So the one is softened by σ²/s and the other by σ²s, s the magnification.
    """
    scale = geometry.magnification(inverse_depth)
    if abs(scale - 1) < SAME_SCALE:
        return base.soft, other.interpolated
    return soften(base.grey, 1 / scale), InterpolatedImage(soften(other.grey, scale))


def _first_step(
    soft: Field,
    interpolated: InterpolatedImage,
    geometry: Epipolar,
    disparity: Field,
    spacing: np.float32,
    settings: DepthSettings,
) -> Field:
    """The step to the minimum, found at every second pixel, in planes; 0 where none is within half a pixel."""
    height, width = shape = geometry.shape
    thin = np.empty_like(disparity[::FIRST_THINNING, ::FIRST_THINNING])

    def look(band: Band) -> None:
        inner, outer = (_thin_rows(rows, FIRST_THINNING) for rows in (band.inner, band.outer))
        some = (slice(band.outer.start, band.outer.stop, FIRST_THINNING), slice(None, None, FIRST_THINNING))
        radius = settings.window_radius // FIRST_THINNING
        window = BaseWindow(np.ascontiguousarray(soft[some]), radius, Window.TENT)
        projection = geometry.project(disparity[some] * spacing, some)
        surface = sample_surface(window, interpolated, projection)
        shift, _, _ = surface.minimum(line_weight(surface.value, window, settings))
        sensitivity = projection.line[2] * spacing
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = (np.abs(shift) <= 0.5) & (sensitivity > 1e-6 * spacing)
            step = select(found, shift / sensitivity, 0)
        thin[inner] = step[inner.start - outer.start :][: inner.stop - inner.start]

    share(look, bands(shape, settings.window_radius), height * width)
    shrink = np.diag([1 / FIRST_THINNING, 1 / FIRST_THINNING, 1])[:2]
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    step = cv2.warpAffine(thin, shrink, (width, height), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(step, np.float32)


def _thin_rows(rows: slice, step: int) -> slice:
    """Those rows in an image of every `step`-th row; they begin at one of them."""
    return slice(rows.start // step, -(-rows.stop // step))


def line_weight(value: Field, window: BaseWindow, settings: DepthSettings) -> Field:
    """λ_ep = s²/σ_ep² of the soft epipolar term."""
    return noise_power(value, window) / np.float32(settings.epipolar_std_px**2)


def line_error(across: Field, variance: Field) -> float:
    """The epipolar residual beyond the matches' own deviation: the error of the motion, px.

    What the motion's error does across the lines it does along them too, where nothing shows it; so it is
    added to the uncertainty of every match. A short baseline then weighs less than a long one.
    """
    sharp = (variance < LINE_SHARP_PX**2) & np.isfinite(across)
    if np.count_nonzero(sharp) < 100:
        return 0.0
    residual = robust_deviation(across[sharp])
    own = max(LINE_SLACK * float(np.sqrt(median(variance[sharp]))), 0.1)
    return float(np.sqrt(max(residual**2 - own**2, 0.0)))
