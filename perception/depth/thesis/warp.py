"""Forward warp of the predicted map to the pixels of the new view, thesis (2.29), occlusions left out."""

import numpy as np
from numpy.typing import NDArray

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Projection

Field = NDArray[np.float32]


def warp_map(
    predicted: InverseDepth,
    moved: Projection,
    reach: int = 1,
    independent: bool = False,
    same_surface: float = 0.04,
) -> InverseDepth:
    """Interpolate the predicted points (x'_i, y'_i) at the pixels by inverse square distance, (2.29).

    Of several points that fall on a pixel the nearest surface hides the others: points that are farther
    than it by more than the part `same_surface` (or three standard deviations) are left out. A pixel on which
    none falls has come into view and is NaN.

    Args:
        predicted: ρ' and P', still at the pixels they were predicted from.
        moved: where those pixels go.
        reach: 1 spreads a point over the four pixels around it, 2 over the 3×3 of the thesis.
        independent: σ² = Σ d⁻⁴ σ_i²/(Σ d⁻²)² as printed. Neighbours that were measured by overlapping windows
            err together, and image after image that formula reduces their deviation; so the default is
            σ = Σ d⁻² σ_i/Σ d⁻².
    """
    height, width = predicted.value.shape
    known = (
        np.isfinite(predicted.value) & np.isfinite(moved.x) & (predicted.value >= 0) & (moved.scale > 1e-3)
    )
    x, y = moved.x[known].astype(np.float64), moved.y[known].astype(np.float64)
    value, variance = predicted.value[known].astype(np.float64), predicted.variance[known].astype(np.float64)
    tolerance = value * same_surface + 3 * np.sqrt(variance)
    if reach == 1:
        left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        cells = [(0, 0), (1, 0), (0, 1), (1, 1)]
    else:
        left, top = np.rint(x).astype(np.int64) - 1, np.rint(y).astype(np.int64) - 1
        cells = [(i, j) for j in range(3) for i in range(3)]
    size = height * width
    nearest = np.zeros(size)
    reached = []
    for i, j in cells:
        column, row = left + i, top + j
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        square = (x - column) ** 2 + (y - row) ** 2
        chosen = np.flatnonzero(inside & (square < (1.0 if reach == 1 else 2.25)))
        place = (row * width + column)[chosen]
        reached.append((chosen, place, 1 / (square[chosen] + 1e-3)))
        close = square[chosen] < 0.5
        np.maximum.at(nearest, place[close], value[chosen[close]])
    weights, values, variances, costs = (np.zeros(size) for _ in range(4))
    cost = predicted.cost[known].astype(np.float64)
    for chosen, place, weight in reached:
        visible = value[chosen] + tolerance[chosen] >= nearest[place]
        chosen, place, weight = chosen[visible], place[visible], weight[visible]
        weights += np.bincount(place, weight, size)
        values += np.bincount(place, weight * value[chosen], size)
        costs += np.bincount(place, weight * cost[chosen], size)
        variances += np.bincount(
            place,
            weight * weight * variance[chosen] if independent else weight * np.sqrt(variance[chosen]),
            size,
        )
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        spread = variances / weights**2 if independent else (variances / weights) ** 2
        return InverseDepth(
            np.where(weights > 0, values / weights, np.nan).reshape(height, width).astype(np.float32),
            np.where(weights > 0, spread, np.nan).reshape(height, width).astype(np.float32),
            np.where(weights > 0, costs / weights, 1.0).reshape(height, width).astype(np.float32),
        )
