"""Forward warp: the predicted map at the pixels of the new view, by bilinear interpolation, occlusions left out.

What (2.29) does for a 3×3 neighbourhood, done backward: each pixel of the new view takes the nearest of
the points that fall on it, and looks up the map where that point's displacement leads back to.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Projection
from perception.image.bands import Band, join_bands
from perception.image.select import select

Field = NDArray[np.float32]
SAME_SURFACE = 0.04
"""Neighbours whose inverse depths differ by more than this part are not interpolated between."""
SLOPE_PX = 7
"""Side of the window over which the slope of a surface is measured."""
STEEPEST = 0.3
"""Slopes of the disparity beyond this are discontinuities."""


def forward_warp(predicted: InverseDepth, moved: Projection) -> InverseDepth:
    """The predicted map at the pixels of the new view; NaN where nothing falls, for that has come into view.

    Args:
        predicted: ρ' (1/m) and P' (1/m²), still at the pixels they were predicted from; height × width.
        moved: where those pixels go.
    """
    height, width = shape = predicted.value.shape
    source = _nearest_source(predicted, moved)
    x, y = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)[:, None]
    away_x, away_y = moved.x - x, moved.y - y
    filled = select(np.isfinite(predicted.value), predicted.value, -1e6)

    def stretch(band: Band) -> tuple[Field]:
        variance = predicted.variance[band.inner] / np.square(_stretching(predicted, moved, band))
        return (np.asarray(variance, np.float32),)

    (variance,) = join_bands(shape, stretch, SLOPE_PX // 2 + 1)

    def fetch(band: Band) -> tuple[Field, ...]:
        here = source[band.inner]
        known, place = here >= 0, np.maximum(here, 0).astype(np.intp)

        def at_source(field: Field) -> Field:
            return np.take(field.reshape(-1), place)

        # The displacement of the point that fell here leads back to where this pixel came from.
        back_x, back_y = x - at_source(away_x), y[band.inner] - at_source(away_y)
        own = at_source(predicted.value)
        between = cv2.remap(filled, back_x, back_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        value = select(np.abs(between - own) <= SAME_SURFACE * own, between, own)
        return (
            select(known, value, np.nan),
            select(known, at_source(variance), np.nan),
            select(known, at_source(predicted.cost), 1),
        )

    return InverseDepth(*join_bands(shape, fetch))


def _stretching(predicted: InverseDepth, moved: Projection, band: Band) -> Field:
    """How far the surface is stretched where it lands, 1 + C·∇ρ; 1 is as it was.

    A point with the error e lands beside its place by C e, where a sloping surface has another depth, so that the
    error at a pixel is e/(1 + C·∇ρ): it grows from image to image where the surface is compressed.
    """
    rows = band.outer
    known = cv2.patchNaNs(predicted.value[rows] * moved.scale[rows], 0)
    smooth = cv2.blur(known, (SLOPE_PX, SLOPE_PX))
    across = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)
    down = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=1, scale=0.5)
    stretched = across * moved.slope_x[rows] + down * moved.slope_y[rows]
    return np.asarray((1 + cv2.patchNaNs(np.clip(stretched, -STEEPEST, STEEPEST), 0))[band.trim], np.float32)


def _nearest_source(predicted: InverseDepth, moved: Projection) -> NDArray[np.int32]:
    """For every pixel the number of the nearest point that falls on it, −1 for none."""
    height, width = shape = predicted.value.shape
    nowhere = height * width

    def aim(band: Band) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        rows = band.inner
        value, x, y = predicted.value[rows], moved.x[rows], moved.y[rows]
        with np.errstate(invalid="ignore"):
            good = (value >= 0) & (moved.scale[rows] > 1e-3)
            column, row = np.rint(x), np.rint(y)
            good &= (column >= 0) & (column < width) & (row >= 0) & (row < height)
        # In whole numbers, for single precision ends at 2²⁴ pixels.
        target = select(good, row, 0).astype(np.int64)
        target *= width
        target += select(good, column, 0).astype(np.int64)
        target += nowhere * ~good
        # Positive floats sort like their bits, so that the greatest key is that of the nearest point.
        key = np.ascontiguousarray(value).view(np.int32).astype(np.int64)
        key <<= 32
        key |= np.arange(rows.start * width, rows.stop * width).reshape(value.shape)
        return np.minimum(target, nowhere), key

    target, key = join_bands(shape, aim)
    best = np.full(nowhere + 1, -1, np.int64)
    np.maximum.at(best, target.reshape(-1), key.reshape(-1))
    # Of a key the lower half is the number, of −1 it is −1.
    source = best[:-1].astype(np.int32).reshape(shape)
    _close_cracks(source)
    return source


def _close_cracks(source: NDArray[np.int32]) -> None:
    """Where a stretched surface leaves single pixels between two of its own, take the one before (in place)."""
    crack = source < 0
    crack[:, 0] = crack[:, -1] = False
    inner = crack[:, 1:-1]
    inner &= (source[:, :-2] >= 0) & (source[:, 2:] >= 0)
    rows, columns = np.nonzero(crack)
    source[rows, columns] = source[rows, columns - 1]
    crack = source < 0
    crack[0] = crack[-1] = False
    crack[1:-1] &= (source[:-2] >= 0) & (source[2:] >= 0)
    rows, columns = np.nonzero(crack)
    source[rows, columns] = source[rows - 1, columns]
