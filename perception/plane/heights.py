"""Heights over a plane, cell by cell: what the residual flow against the plane's homography says."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.plane.parallax import Parallax
from perception.plane.plane_motion import PlaneMotion
from perception.plane.second_image import SecondImage
from perception.plane.template import SLOPE, Template

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]
SIDES_PX = (8, 16, 24)
"""Cells; the one with the strongest answer counts."""
MIDDLE_PX = 16
STRIDE_PX = 4
EDGE_PX = 0.1
"""What aliasing and interpolation shift an edge by, beside noise."""
ALIKE = 1.47
"""Standard deviation of a cell's answer over that of independent pixels: what errs, errs alike in neighbours."""
FILLED = 0.9
"""Part of a cell that must be seen."""
RIM_PX = 3
"""Pixels beside what is not seen that the filters spoil."""
SUSPECT = 3.0
"""Mean square residual of a cell, in that of the plane, from which on taller things are looked for."""
BETTER = 0.6
"""What is left of it when a parallel plane explains the cell."""
STEP_PX = 1.0
"""By how much the parallel planes that are tried are displaced against each other."""
LOWEST, HIGHEST = -0.3, 0.6
"""Heights that are looked for, as parts of the camera's own."""


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights of cells over a plane as parts of the camera's height over it: sides × rows × columns, NaN unknown."""

    x_px: Matrix
    """Columns of the cells' centres in the first image, rows × columns."""
    y_px: Matrix
    height: Field
    """h/H; negative for a hole."""
    std: Field
    score: Field
    """k in its standard deviations: normal (0, 1) on the plane, positive above it."""


def measure_heights(
    template: Template, image: NDArray[np.uint8] | Field, seen: PlaneMotion, parallax: Parallax
) -> HeightMap:
    """Heights over the plane whose motion between the template's image and another is known.

    With r = b(Hx) − a(x), the light taken out, and s = ∇m·v the change of grey by the parallax v, a cell says
    k = −Σ r s/var / Σ s²/var, r and s without their means, var = σ² + (κ s/|v|)²; h/H = k/(1 + k). Where much is left
    that k v does not explain to first order, parallels of the plane are tried before.
    """
    window = template.window
    second = SecondImage(np.asarray(image, np.float32), window, seen.homography)
    pair = _Pair(template.finest.lit(seen.light), second.warped(seen.homography), parallax, seen.noise)
    k, std = _answer(pair)
    misfit = _misfit(pair.weight, pair.residual, pair.known)
    if np.nanmax(misfit, initial=0.0) > SUSPECT:
        _try_parallels(k, std, misfit, pair, second, seen)
    rows, columns = k.shape[1:]
    x, y = (np.arange(number) * STRIDE_PX + (STRIDE_PX - 1) / 2 for number in (columns, rows))
    places = np.meshgrid(x + window.left, y + window.top)
    return HeightMap(places[0], places[1], k / (1 + k), std / (1 + k) ** 2, k / std)


class _Pair:
    """The first image, lit as the second, and the second warped onto it; what differs, and what parallax changes."""

    def __init__(self, first: Field, warped: Field, parallax: Parallax, noise: float) -> None:
        self.first, self.parallax, self.noise = first, parallax, noise
        hidden = ~np.isfinite(warped) | ~np.isfinite(parallax.across)
        rim = np.ones((2 * RIM_PX + 1,) * 2, np.uint8)
        self.known = cv2.erode((~hidden).astype(np.uint8), rim, borderValue=0).astype(np.float32)
        warped = np.where(hidden, first, warped)
        middle = (first + warped) / 2
        across, down = np.where(hidden, 0, parallax.across), np.where(hidden, 0, parallax.down)
        self.residual = warped - first
        slope_x, slope_y = (cv2.filter2D(middle, cv2.CV_32F, kernel) for kernel in (SLOPE, SLOPE.T))
        self.change = np.asarray(slope_x * across + slope_y * down, np.float32)
        reach = np.maximum(across * across + down * down, np.float32(1e-6))
        variance = np.float32(noise**2) + np.float32(EDGE_PX**2) * self.change * self.change / reach
        self.weight = self.known / variance


def _answer(pair: _Pair, about: float = 0.0) -> tuple[Field, Field]:
    """k and its standard deviation in cells of all sides, when the warp was that of the parallel at k = `about`."""
    weight, r, s = pair.weight, pair.residual, pair.change
    maps = (weight, weight * r, weight * s, weight * r * s, weight * s * s, pair.known)
    answers = []
    for side in SIDES_PX:
        w, wr, ws, wrs, wss, number = (sum_cells(part, side) for part in maps)
        with np.errstate(invalid="ignore", divide="ignore"):
            power = wss - ws * ws / w
            power[~((number >= FILLED * side * side) & (power > 0))] = np.nan
            answers.append(
                (np.float32(about) - (wrs - wr * ws / w) / power, np.float32(ALIKE) / np.sqrt(power))
            )
    return np.stack([k for k, _ in answers]), np.stack([std for _, std in answers])


def _misfit(weight: Field, residual: Field, known: Field) -> Field:
    """Mean square residual of cells, less their means, in the expected variance; NaN where too little is seen."""
    parts = (known, weight, weight * residual, weight * residual * residual)
    number, total, first, second = (sum_cells(part, MIDDLE_PX) for part in parts)
    with np.errstate(invalid="ignore", divide="ignore"):
        misfit = np.asarray((second - first * first / total) / number, np.float32)
    misfit[number < FILLED * MIDDLE_PX**2] = np.nan
    return misfit


def _try_parallels(
    k: Field, std: Field, misfit: Field, pair: _Pair, second: SecondImage, seen: PlaneMotion
) -> None:
    """Let cells that nothing near the plane explains answer from the parallel plane that explains them best."""
    parallax = pair.parallax
    longest = float(np.nanmax(np.hypot(parallax.across, parallax.down)))
    least, most = (height / (1 - height) for height in (LOWEST, HIGHEST))
    steps = np.arange(np.ceil(least * longest / STEP_PX), np.floor(most * longest / STEP_PX) + 1)
    best, place = np.where(misfit > SUSPECT, BETTER * misfit, -np.inf), np.zeros(misfit.shape)
    for about in steps[steps != 0] * STEP_PX / longest:
        residual = second.warped(parallax.at(float(about), seen.homography)) - pair.first
        known = np.isfinite(residual) * pair.known
        trial = _misfit(pair.weight * known, np.where(known > 0, residual, 0), known)
        better = trial < best
        best[better], place[better] = trial[better], about
    for about in np.unique(place[place != 0]):
        warped = second.warped(parallax.at(float(about), seen.homography))
        other, deviation = _answer(_Pair(pair.first, warped, parallax, pair.noise), float(about))
        k[:, place == about], std[:, place == about] = other[:, place == about], deviation[:, place == about]


def sum_cells(field: Field, side: int) -> Field:
    """Sums over square cells; the box of an even side about pixel i has its middle half a pixel before."""
    total = cv2.boxFilter(field, cv2.CV_32F, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.ascontiguousarray(total[STRIDE_PX // 2 :: STRIDE_PX, STRIDE_PX // 2 :: STRIDE_PX])
