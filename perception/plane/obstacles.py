"""What stands out of a plane or is missing from it: cells whose height is many deviations, put together."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.plane.heights import SIDES_PX, HeightMap

LIMIT = 6.0
"""Deviations of a cell that is no plane; one of 600 empty floors of `tools/reproduce floor` shows more."""


SURE = 0.4
"""Part of the strongest score of a region that the cells have which say its height."""


@dataclass(frozen=True)
class Obstacle:
    """A region of cells that all stand above the plane, or all lie below it: a hole."""

    height: float
    """h/H, the upper quartile of its surest cells; negative for a hole."""
    std: float
    """Of such a cell."""
    score: float
    """The strongest, in standard deviations."""
    place_px: tuple[float, float]
    """The middle of its surest cells, column and row in the first image."""
    box_px: tuple[float, float, float, float]
    """Left, top, right, bottom of the region in the first image."""
    cells: int

    @property
    def hole(self) -> bool:
        """Whether something is missing from the plane."""
        return self.height < 0


def find_obstacles(heights: HeightMap, limit: float = LIMIT) -> list[Obstacle]:
    """Regions of touching cells beyond `limit` deviations, the largest first."""
    score = np.nan_to_num(heights.score)
    strongest = np.take_along_axis(score, np.abs(score).argmax(axis=0)[None], axis=0)[0]
    found = []
    for sign in (1, -1):
        beyond = (sign * strongest >= limit).astype(np.uint8)
        number, labels = cv2.connectedComponents(beyond, connectivity=8)
        found += [_describe(heights, score, labels == label) for label in range(1, number)]
    return sorted(found, key=lambda obstacle: -obstacle.cells)


def _describe(heights: HeightMap, score: NDArray[np.float32], cells: NDArray[np.bool_]) -> Obstacle:
    strength = np.abs(score) * cells
    # The highest score alone may be that of a cell which matched something else, far off.
    layer, row, column = np.nonzero(strength >= SURE * strength.max())
    height, std = heights.height[layer, row, column], heights.std[layer, row, column]
    # Cells that reach over its rim see the plane, too.
    sign, reach = float(np.sign(height.sum())), SIDES_PX[0] / 2
    x, y = heights.x_px[cells], heights.y_px[cells]
    return Obstacle(
        sign * float(np.quantile(sign * height, 0.75)),
        float(np.median(std)),
        sign * float(strength.max()),
        (float(heights.x_px[row, column].mean()), float(heights.y_px[row, column].mean())),
        (float(x.min() - reach), float(y.min() - reach), float(x.max() + reach), float(y.max() + reach)),
        int(cells.sum()),
    )
