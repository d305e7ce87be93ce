"""Where an image departs from the motion of a plane, when neither the camera nor its motion is known."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.plane.heights import FILLED, MIDDLE_PX, RIM_PX, STRIDE_PX, sum_cells
from perception.plane.plane_motion import PlaneMotion
from perception.plane.second_image import SecondImage
from perception.plane.template import SLOPE, Template

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DepartureMap:
    """By how much the cells of the first image move otherwise than the plane, rows × columns; NaN where unknown."""

    x_px: Matrix
    """Columns of the cells' centres."""
    y_px: Matrix
    departure_px: Field
    """Up to a pixel the root mean square of the residual flow; beyond, only that it is large."""

    def regions(self, limit_px: float) -> list["DepartingRegion"]:
        """Touching cells that move otherwise by at least `limit_px`, the largest region first."""
        beyond = (np.nan_to_num(self.departure_px) >= limit_px).astype(np.uint8)
        number, labels = cv2.connectedComponents(beyond, connectivity=8)
        found = []
        for label in range(1, number):
            cells = labels == label
            x, y, half = self.x_px[cells], self.y_px[cells], STRIDE_PX / 2
            box = (float(x.min() - half), float(y.min() - half), float(x.max() + half), float(y.max() + half))
            found.append(DepartingRegion(box, int(cells.sum())))
        return sorted(found, key=lambda region: -region.cells)


@dataclass(frozen=True)
class DepartingRegion:
    """Left, top, right, bottom in the first image, and how many cells of 4 × 4 px it has."""

    box_px: tuple[float, float, float, float]
    cells: int

    @property
    def middle_px(self) -> tuple[float, float]:
        """Column and row of the middle of its box."""
        left, top, right, bottom = self.box_px
        return (left + right) / 2, (top + bottom) / 2


def measure_departure(
    template: Template, image: NDArray[np.uint8] | Field, seen: PlaneMotion
) -> DepartureMap:
    """√(2 (Σ r² − n σ²)/Σ |∇m|²) over cells of 16 pixels, r = b(Hx) − a(x) less its mean and light, m their mean.

    A shift by d leaves r = ∇m·d, and on average over directions r² = |∇m|² d²/2.
    """
    window = template.window
    first = template.finest.lit(seen.light)
    warped = SecondImage(np.asarray(image, np.float32), window, seen.homography).warped(seen.homography)
    hidden = ~np.isfinite(warped)
    known = cv2.erode((~hidden).astype(np.uint8), np.ones((2 * RIM_PX + 1,) * 2, np.uint8), borderValue=0)
    known = known.astype(np.float32)
    warped = np.where(hidden, first, warped)
    middle = (first + warped) / 2
    slopes = (np.asarray(cv2.filter2D(middle, cv2.CV_32F, kernel), np.float32) for kernel in (SLOPE, SLOPE.T))
    texture = sum(slope * slope for slope in slopes)
    r = warped - first
    parts = (known, known * r, known * r * r, known * texture)
    number, total, square, weight = (sum_cells(np.asarray(part, np.float32), MIDDLE_PX) for part in parts)
    with np.errstate(divide="ignore", invalid="ignore"):
        noise = number * np.float32(seen.noise**2)
        left = np.maximum(square - total * total / number - noise, 0)
        departure = np.sqrt(2 * left / np.maximum(weight, noise))
    departure[number < FILLED * MIDDLE_PX**2] = np.nan
    x, y = (np.arange(size) * STRIDE_PX + (STRIDE_PX - 1) / 2 for size in departure.shape[::-1])
    places = np.meshgrid(x + window.left, y + window.top)
    return DepartureMap(places[0], places[1], departure)
