"""Pictures of a world: every surface painted over its own part of the image, nearest wins.

Each pixel is the mean of 2 x 2 samples. A sample takes the texture at the mip level whose texels are as far
apart as the samples, blended between levels (trilinear), so a distant texture fades to its mean instead of
crawling. On a plane everything needed is affine in the ray over 1/Z: three outer sums and one division.
"""

from collections.abc import Callable
from math import ceil, floor, log2, pi

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.optics import Optics, Window
from sim_devices.worlds.placement import Placement
from sim_devices.worlds.sight import (
    Affine,
    FlatSight,
    RoundSight,
    Sight,
    extent,
    meet_sphere,
    over_rays,
    see,
    sphere_coordinates,
)
from sim_devices.worlds.surface import texture_at
from sim_devices.worlds.texture import Texture
from sim_devices.worlds.world import World

Grey = NDArray[np.float32]
Mask = NDArray[np.bool_]
SAMPLES = 2
_CELLS = 8
_rays: dict[tuple[Optics, Window], tuple[Grey, Grey]] = {}


def render(world: World, optics: Optics, camera: Placement, t: float, window: Window | None = None) -> Grey:
    """The light that falls on the pixels of ``window`` at time ``t``, grey levels (height, width).

    ``camera`` is the placement of the optical frame (x right, y down, z forward) in the world. A window costs
    what its own pixels cost. Not clipped, not quantised, no noise: that is the sensor's part.
    """
    window = optics.whole if window is None else window
    columns, rows = _ray_axes(optics, window)
    canvas = np.full((len(rows), len(columns)), world.sky * world.light, np.float32)
    near = np.zeros(canvas.shape, np.float32)
    sights: list[tuple[Sight, Texture]] = []
    t = world.elapsed(t)
    for surface in world.surfaces:
        texture = texture_at(surface, t)
        sight = None if texture is None else see(surface, surface.motion(t), camera)
        if texture is not None and sight is not None:
            sights.append((sight, texture))
    sights.sort(key=lambda pair: pair[0].nearest)
    for sight, texture in sights:
        part = extent(sight, columns, rows)
        if part is None:
            continue
        light = 1.0 if sight.surface.glows else world.light
        if isinstance(sight, FlatSight):
            _paint_flat(sight, texture, light, columns, rows, part, canvas, near)
        else:
            _paint_round(sight, texture, light, columns, rows, part, canvas, near)
    return cv2.resize(canvas, (window.width, window.height), interpolation=cv2.INTER_AREA)  # type: ignore[return-value]


def _ray_axes(optics: Optics, window: Window) -> tuple[Grey, Grey]:
    key = (optics, window)
    if key not in _rays:
        if len(_rays) > 64:
            _rays.clear()
        optics.check(window)
        columns, rows = optics.rays(window, SAMPLES)
        _rays[key] = columns.astype(np.float32), rows.astype(np.float32)
    return _rays[key]


def _paint_flat(
    sight: FlatSight,
    texture: Texture,
    light: float,
    columns: Grey,
    rows: Grey,
    part: tuple[slice, slice],
    canvas: Grey,
    near: Grey,
) -> None:
    columns, rows = columns[part[1]], rows[part[0]]
    inverse_depth = over_rays(sight.plane[0], columns, rows)
    behind = near[part]
    visible: Mask = inverse_depth > behind
    if not _covers(sight, columns, rows):
        visible &= _inside(sight, inverse_depth, columns, rows)
    if not visible.any():
        return
    if texture.levels[0].size == 1:
        np.copyto(canvas[part], np.float32(light * texture.levels[0][0, 0]), where=visible)
    else:
        shade = _shade_flat(sight, texture, inverse_depth, columns, rows)
        if light != 1.0:
            shade *= np.float32(light)
        np.copyto(canvas[part], shade, where=visible)
    np.copyto(behind, inverse_depth, where=visible)


def _covers(sight: FlatSight, columns: Grey, rows: Grey) -> bool:
    """Whether every sample of the part meets the rectangle: its four corners do, and it is convex."""
    if sight.surface.elliptic:
        return False
    half = (sight.surface.width / 2.0, sight.surface.height / 2.0)
    for x in (float(columns[0]), float(columns[-1])):
        for y in (float(rows[0]), float(rows[-1])):
            w, u, v = (a * x + b * y + c for a, b, c in sight.plane)
            if w <= 0.0 or abs(u) > half[0] * w or abs(v) > half[1] * w:
                return False
    return True


def _inside(sight: FlatSight, inverse_depth: Grey, columns: Grey, rows: Grey) -> Mask:
    surface = sight.surface
    u = over_rays(_scaled(sight.plane[1], 2.0 / surface.width), columns, rows)
    v = over_rays(_scaled(sight.plane[2], 2.0 / surface.height), columns, rows)
    if surface.elliptic:
        u *= u
        v *= v
        u += v
        return u <= inverse_depth * inverse_depth
    np.abs(u, out=u)
    np.abs(v, out=v)
    np.maximum(u, v, out=u)
    return u <= inverse_depth


def _shade_flat(sight: FlatSight, texture: Texture, inverse_depth: Grey, columns: Grey, rows: Grey) -> Grey:
    surface = sight.surface
    border = cv2.BORDER_WRAP if texture.tiled else cv2.BORDER_REPLICATE
    # Behind the horizon of the plane 1/Z <= 0: those samples are masked, they only must not overflow.
    depth = np.reciprocal(np.maximum(inverse_depth, np.float32(1e-6)))
    detail = _detail(sight, texture, columns, rows)
    w = sight.plane[0]
    per_metre = texture.repeat[0] / surface.width, texture.repeat[1] / surface.height

    def sample(level: int) -> Grey:
        picture = texture.levels[level]
        maps = []
        for axis, count in ((0, picture.shape[1]), (1, picture.shape[0])):
            a, b, c = _scaled(sight.plane[1 + axis], per_metre[axis] * count)
            centre = texture.repeat[axis] * count / 2.0 - 0.5
            place = over_rays((a + centre * w[0], b + centre * w[1], c + centre * w[2]), columns, rows)
            place *= depth
            maps.append(place)
        return cv2.remap(picture, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=border)  # type: ignore[return-value]

    return _blend(sample, detail, len(texture.levels) - 1, (len(rows), len(columns)))


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


def _scaled(row: Affine, factor: float) -> Affine:
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


def _paint_round(
    sight: RoundSight,
    texture: Texture,
    light: float,
    columns: Grey,
    rows: Grey,
    part: tuple[slice, slice],
    canvas: Grey,
    near: Grey,
) -> None:
    columns, rows = columns[part[1]], rows[part[0]]
    depth, _ = meet_sphere(sight, columns, rows)
    inverse_depth = np.reciprocal(depth)
    behind = near[part]
    with np.errstate(invalid="ignore"):
        visible: Mask = inverse_depth > behind
    if not visible.any():
        return
    body = sphere_coordinates(sight, depth, columns, rows)
    height, width = texture.levels[0].shape
    step = float(columns[-1] - columns[0]) / max(len(columns) - 1, 1)
    across = (
        step
        * sight.nearest
        / sight.surface.radius
        * max(width * texture.repeat[0] / (2.0 * pi), height * texture.repeat[1] / pi)
    )
    level = min(max(0, round(log2(max(across, 1e-6)))), len(texture.levels) - 1)
    picture = texture.levels[level]
    height, width = picture.shape
    longitude = np.arctan2(body[1], body[0]) * np.float32(-texture.repeat[0] * width / (2.0 * pi))
    longitude += np.float32(texture.repeat[0] * width / 2.0 - 0.5)
    latitude = np.arcsin(np.clip(body[2], -1.0, 1.0)) * np.float32(-texture.repeat[1] * height / pi)
    latitude += np.float32(texture.repeat[1] * height / 2.0 - 0.5)
    shade = cv2.remap(picture, longitude, latitude, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    np.copyto(canvas[part], np.multiply(shade, np.float32(light)), where=visible)
    np.copyto(behind, inverse_depth, where=visible)
