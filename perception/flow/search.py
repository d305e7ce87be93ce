"""By how many whole pixels a window has moved, whether that is texture or noise, and whether it is ambiguous."""

from dataclasses import dataclass
from math import ceil, floor, isfinite

import numpy as np
from numpy.typing import NDArray

from perception.flow.strip import COARSE_NOISE, COARSE_REACH, Strip
from perception.flow.window import Window

Field = NDArray[np.float32]

TEXTURE = 0.32
"""Correlation above which it is texture. Of noise alone the best of 17 shifts reaches .24 once in a thousand windows,
with vignetting of 40 % .28; a wall of contrast .05 (σ 2 grey levels in noise of 2) stays above .37."""
RIVAL = 0.6
"""Another shift with this part of the best correlation makes it ambiguous; 1/f textures stay below .45.

And then maxima of this part of that again are listed: of stripes of 4 px a maximum between two whole shifts is lost.
"""
APART_PX = 3
"""Shifts nearer than this to the best one belong to the same peak."""
SLANT_PX = 4
"""The halves of the window of a slanted wall may have shifted this much more and less than the whole."""
HALF_PART = 0.2
"""A half with less than this part of the whole window's correlation has too little texture for a slope."""
LEAST_POWER = COARSE_NOISE
"""Of a coarse pixel: that of white noise of one grey level. The bands that rounding makes of light reach two thirds."""
BROAD, FALLEN = 0.7, 0.94
"""A peak broader than that is believed if it correlates by the one, and by that part less 3 px to both sides of it."""
FEWEST_COLUMNS = 16
NEAR_PX = 8
BEYOND_PX = 3
"""A maximum at the end of the range must have room to fall again."""


@dataclass(frozen=True, slots=True)
class Search:
    """Correlation of the coarse images over whole shifts: `scores[i]` at `lowest + i` px, −1 where unknown.

    A shift is the content's motion to the right from the past to the present image. halves: Σ a b of the window's left
    and right half alone, (2, shifts). peaks: shifts of the highest maxima to a part of a pixel, the best one first.
    cut_off: as good or nearly as good a shift may lie beyond an end of the range. broad: the best peak hardly falls
    off, as light's does.
    """

    lowest: int
    scores: Field
    halves: Field
    peaks: tuple[float, ...]
    cut_off: bool
    broad: bool

    @property
    def texture(self) -> bool:
        """Whether both images show the same texture, though perhaps at a shift that is not known."""
        return bool(self.scores.max() >= TEXTURE)

    @property
    def clear(self) -> bool:
        """Whether there is one shift that fits and no other."""
        return len(self.peaks) == 1 and not self.cut_off and not self.broad

    def slope_at(self, shift: float) -> float:
        """First guess of the flow at the window's right edge minus that in its middle: its halves' peaks, 1 apart.

        0 where one of them sees nothing near the shift.
        """
        at = round(shift) - self.lowest
        if not 0 <= at < len(self.scores):
            return 0.0
        first = max(at - SLANT_PX, 0)
        tops = []
        for half in self.halves.tolist():
            near = half[first : at + SLANT_PX + 1]
            top = near.index(max(near))
            if top in (0, len(near) - 1) or near[top] < HALF_PART * float(self.halves[:, at].sum()):
                return 0.0
            tops.append(_vertex(near, top))
        return tops[1] - tops[0]

    def score(self, shift: float) -> float:
        """The correlation between whole shifts, by the cubic through four of them; −1 where they are not known."""
        first = floor(shift) - self.lowest - 1
        if not 0 <= first <= len(self.scores) - 4:
            return -1.0
        before, low, high, after = (float(s) for s in self.scores[first : first + 4])
        part = shift - floor(shift)
        bends = (2 - part) * (before - 2 * low + high) + (1 + part) * (low - 2 * high + after)
        return low * (1 - part) + high * part - part * (1 - part) / 6 * bends


def search_near(
    now: Strip, past: Strip, window: Window, predicted_px: float, everywhere: tuple[float, float]
) -> Search:
    """Search around a predicted shift, and everywhere a shift can be when it is not there or not known (NaN)."""
    if isfinite(predicted_px):
        found = search(now, past, window, floor(predicted_px) - NEAR_PX, ceil(predicted_px) + NEAR_PX)
        if found.texture and not found.cut_off:
            return found
    return search(now, past, window, floor(min(everywhere)) - BEYOND_PX, ceil(max(everywhere)) + BEYOND_PX)


def search(now: Strip, past: Strip, window: Window, lowest: int, highest: int) -> Search:
    """Correlate the window of the present image with the past one at every whole shift from `lowest` to `highest`.

    Score = Σ a b / √(Σ a² Σ b²) over the columns that both images have, a and b second derivatives along the row.
    One matrix product holds all columns' products with all columns; a shift is one of its diagonals.
    """
    count, span = highest - lowest + 1, window.width + highest - lowest
    template, own, known = _columns(now, window.left, window.width)
    other, others, there = _columns(past, window.left - highest, span)
    products = template @ other.T
    step, item = products.strides
    # Row j, place i of this view is the product of column j with that which is i columns further on.
    diagonals: Field = np.ndarray((window.width, count), np.float32, products, strides=(step + item, item))
    middle = window.width // 2
    halves = np.add.reduceat(diagonals, (0, middle))[:, ::-1]
    power = np.correlate(there, own) * np.correlate(others, known)
    columns = np.correlate(there, known)
    fit = (columns >= FEWEST_COLUMNS) & (power > (LEAST_POWER * window.height * columns) ** 2)
    if now.clipped or past.clipped:
        fit[:] = False
    scores = np.full(count, -1.0, np.float32)
    np.divide(halves.sum(axis=0), np.sqrt(power[::-1]), out=scores, where=fit[::-1])
    return Search(lowest, scores, halves, *_peaks(lowest, scores))


def _columns(strip: Strip, left: int, width: int) -> tuple[Field, Field, Field]:
    """Coarse columns from the image's column `left` on, their powers, and which are there; the others are 0."""
    start = left - strip.first
    begin, end = max(start, COARSE_REACH), min(start + width, strip.columns - COARSE_REACH)
    if (begin, end) == (start, start + width):
        return strip.coarse[begin:end], strip.power[begin:end], np.ones(width, np.float32)
    columns, known = np.zeros((width, strip.coarse.shape[1]), np.float32), np.zeros((2, width), np.float32)
    if begin < end:
        part = slice(begin - start, end - start)
        columns[part], known[0, part], known[1, part] = strip.coarse[begin:end], strip.power[begin:end], 1
    return columns, known[0], known[1]


def _peaks(lowest: int, scores: Field) -> tuple[tuple[float, ...], bool, bool]:
    values: list[float] = scores.tolist()
    top = max(values)
    if top < TEXTURE:
        return (), False, False
    best, last, limit = values.index(top), len(values) - 1, RIVAL * top
    left, right = max(best - APART_PX, 0), min(best + APART_PX, last)
    rises_out = (
        values[0] >= limit and values[0] > values[1],
        values[last] >= limit and values[last] > values[last - 1],
    )
    cut_off = any(rises_out) or min(values[max(best - 1, 0)], values[min(best + 1, last)]) <= -1
    beyond = [i for i in [*range(left), *range(right + 1, last + 1)] if values[i] >= limit]
    listed = RIVAL * limit if beyond else top
    others = (i for i in range(1, last) if i != best and values[i] >= listed)
    peaks = [i for i in others if values[i - 1] <= values[i] > values[i + 1]]
    broad = not peaks and bool(beyond) and not any(rises_out)
    broad = broad and (top < BROAD or max(values[left], values[right]) > FALLEN * top)
    if 0 < best < last and min(values[best - 1], values[best + 1]) > -1:
        peaks.append(best)
    peaks.sort(key=lambda i: -values[i])
    return tuple(lowest + _vertex(values, i) for i in peaks), cut_off, broad


def _vertex(values: list[float], at: int) -> float:
    """The top of the parabola through a maximum and its neighbours."""
    before, top, after = values[at - 1 : at + 2]
    bend = before - 2 * top + after
    return at + (0.5 * (before - after) / bend if bend < 0 else 0.0)
