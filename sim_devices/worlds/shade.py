"""A texture on a plane: where each ray meets it, at the mip level of its samples.

A sample takes the texture at the level whose texels are as far apart as the samples, blended between levels
(trilinear), so a distant texture fades to its mean instead of crawling.
"""

from collections.abc import Callable
from math import ceil, floor

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.sight import Affine, FlatSight, over_rays
from sim_devices.worlds.texture import Texture

Grey = NDArray[np.float32]
_CELLS = 8


def shade_flat(sight: FlatSight, texture: Texture, inverse_depth: Grey, columns: Grey, rows: Grey) -> Grey:
    """Grey levels (rows, columns) of the texture where the rays meet the plane."""
    surface = sight.surface
    border = cv2.BORDER_WRAP if texture.tiled else cv2.BORDER_REPLICATE
    # Behind the horizon of the plane 1/Z <= 0: those samples are masked, they only must not overflow.
    depth = np.reciprocal(np.maximum(inverse_depth, np.float32(1e-6)))
    detail = _detail(sight, texture, columns, rows)
    w = sight.plane[0]
    per_metre = texture.repeat[0] / surface.width, texture.repeat[1] / surface.height
    first = _first_tile(sight, texture, columns, rows)

    def sample(level: int) -> Grey:
        picture = texture.levels[level]
        maps = []
        for axis, count in ((0, picture.shape[1]), (1, picture.shape[0])):
            a, b, c = scaled(sight.plane[1 + axis], per_metre[axis] * count)
            centre = texture.repeat[axis] * count / 2.0 - 0.5 + first[axis] * count
            place = over_rays((a + centre * w[0], b + centre * w[1], c + centre * w[2]), columns, rows)
            place *= depth
            maps.append(place)
        return cv2.remap(picture, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=border)  # type: ignore[return-value]

    return _blend(sample, detail, len(texture.levels) - 1, (len(rows), len(columns)))


def _first_tile(sight: FlatSight, texture: Texture, columns: Grey, rows: Grey) -> tuple[float, float]:
    """The texture's offset, less the whole pictures by which the middle of the part lies away from the first.

    The samples then lie in or near one picture, where ``cv2.remap`` is fast and float32 is fine.
    """
    if not texture.tiled:
        return 0.0, 0.0
    x, y = float(columns[len(columns) // 2]), float(rows[len(rows) // 2])
    w, u, v = (a * x + b * y + c for a, b, c in sight.plane)
    if w <= 0.0:
        return texture.offset
    across = texture.offset[0] - floor(
        texture.offset[0] + texture.repeat[0] * (0.5 + u / w / sight.surface.width)
    )
    down = texture.offset[1] - floor(
        texture.offset[1] + texture.repeat[1] * (0.5 + v / w / sight.surface.height)
    )
    return across, down


def _detail(sight: FlatSight, texture: Texture, columns: Grey, rows: Grey) -> Grey:
    """Mip level (a float) on a coarse grid over the part: log2 of the texels between neighbouring samples."""
    surface = sight.surface
    height, width = texture.levels[0].shape
    texels = texture.repeat[0] * width / surface.width, texture.repeat[1] * height / surface.height
    x, step_x = _cell_centres(columns, min(_CELLS, len(columns)))
    y, step_y = _cell_centres(rows, min(_CELLS, len(rows)))
    plane = np.array(sight.plane)
    over = plane[:, 1, None, None] * y[:, None] + (plane[:, 0, None] * x + plane[:, 2, None])[:, None, :]
    depth = 1.0 / np.maximum(over[0], 1.0 / max(z for _, _, z in sight.corners))
    place = over[1:] * depth
    slope = plane[1:, :2].T[:, :, None, None] - plane[0, :2][:, None, None, None] * place
    slope *= np.array(((texels[0] * step_x, texels[1] * step_x), (texels[0] * step_y, texels[1] * step_y)))[
        :, :, None, None
    ]
    slope *= slope
    longest = np.maximum(*(slope[:, 0] + slope[:, 1])) * (depth * depth)
    detail: Grey = (0.5 * np.log2(np.maximum(longest, 1e-12))).astype(np.float32)
    return detail


def _cell_centres(axis: Grey, cells: int) -> tuple[NDArray[np.float64], float]:
    first, count = float(axis[0]), len(axis)
    step = (float(axis[-1]) - first) / max(count - 1, 1)
    places = (np.arange(cells, dtype=np.float64) + 0.5) * (count / cells) - 0.5
    return np.asarray(first + step * places, np.float64), step


def scaled(row: Affine, factor: float) -> Affine:
    """The row that gives so many times as much."""
    return row[0] * factor, row[1] * factor, row[2] * factor


def _blend(sample: Callable[[int], Grey], detail: Grey, last: int, shape: tuple[int, int]) -> Grey:
    low, high = float(detail.min()), float(detail.max())
    finest = min(max(0, floor(low)), last)
    coarsest = min(max(0, ceil(high)), last)
    shade = sample(finest)
    if coarsest == finest:
        return shade
    if high - low < 0.02:
        part = min(max(0.0, (low + high) / 2.0 - finest), 1.0)
        return cv2.addWeighted(shade, 1.0 - part, sample(finest + 1), part, 0.0)  # type: ignore[return-value]
    levels = cv2.resize(detail, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    for level in range(finest + 1, coarsest + 1):
        part_of = np.clip(levels - np.float32(level - 1), np.float32(0.0), np.float32(1.0))
        coarser = sample(level)
        coarser -= shade
        coarser *= part_of
        shade += coarser
    return shade
