"""Pictures of a world: every surface painted over its own part of the image, nearest wins.

Each pixel is the mean of 2 x 2 samples. On a plane everything needed is affine in the ray over 1/Z: three
outer sums and one division.
"""

from math import log2, pi

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.light import Light, light_on
from sim_devices.worlds.optics import Optics, Window
from sim_devices.worlds.placement import Placement
from sim_devices.worlds.shade import scaled, shade_flat
from sim_devices.worlds.sight import (
    FlatSight,
    RoundSight,
    Sight,
    extent,
    meet_sphere,
    over_rays,
    pyramid,
    see,
    sphere_coordinates,
)
from sim_devices.worlds.surface import texture_at
from sim_devices.worlds.texture import Texture
from sim_devices.worlds.world import World

Grey = NDArray[np.float32]
Mask = NDArray[np.bool_]
SAMPLES = 2
_SURELY_NEARER = 1.00001
"""Depth by depth: what is painted hides what is farther, whatever float32 rounds."""
_rays: dict[tuple[Optics, Window], tuple[Grey, Grey, NDArray[np.float64]]] = {}


def render(world: World, optics: Optics, camera: Placement, t: float, window: Window | None = None) -> Grey:
    """The light that falls on the pixels of ``window`` at time ``t``, grey levels (height, width).

    ``camera`` is the placement of the optical frame (x right, y down, z forward) in the world. A window costs
    what its own pixels cost. Not clipped, not quantised, no noise: that is the sensor's part.
    """
    window = optics.whole if window is None else window
    columns, rows, sides = _ray_axes(optics, window)
    t = world.elapsed(t)
    light, glow = light_on(world, camera, t), Light(1.0)
    canvas = np.full((len(rows), len(columns)), world.sky * light.level, np.float32)
    near = np.zeros(canvas.shape, np.float32)
    sights: list[tuple[Sight, Texture]] = []
    for surface in world.within(camera, sides):
        texture = texture_at(surface, t)
        sight = None if texture is None else see(surface, surface.motion(t), camera)
        if texture is not None and sight is not None:
            sights.append((sight, texture))
    sights.sort(key=lambda pair: pair[0].nearest)
    for sight, texture in sights:
        part = extent(sight, columns, rows)
        if part is None:
            continue
        shine = glow if sight.surface.glows else light
        if isinstance(sight, RoundSight):
            _paint_round(sight, texture, shine, columns, rows, part, canvas, near)
        elif float(near[part].min()) * sight.nearest < _SURELY_NEARER:
            _paint_flat(sight, texture, shine, columns, rows, part, canvas, near)
    return cv2.resize(canvas, (window.width, window.height), interpolation=cv2.INTER_AREA)  # type: ignore[return-value]


def _ray_axes(optics: Optics, window: Window) -> tuple[Grey, Grey, NDArray[np.float64]]:
    key = (optics, window)
    if key not in _rays:
        if len(_rays) > 64:
            _rays.clear()
        optics.check(window)
        columns, rows = optics.rays(window, SAMPLES)
        _rays[key] = columns.astype(np.float32), rows.astype(np.float32), pyramid(columns, rows)
    return _rays[key]


def _paint_flat(
    sight: FlatSight,
    texture: Texture,
    light: Light,
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
    if texture.levels[0].size == 1 and light.even:
        np.copyto(canvas[part], np.float32(light.level * texture.levels[0][0, 0]), where=visible)
    else:
        shade = shade_flat(sight, texture, inverse_depth, columns, rows)
        light.fall_on(shade, inverse_depth, columns, rows)
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
    u = over_rays(scaled(sight.plane[1], 2.0 / surface.width), columns, rows)
    v = over_rays(scaled(sight.plane[2], 2.0 / surface.height), columns, rows)
    if surface.elliptic:
        u *= u
        v *= v
        u += v
        return u <= inverse_depth * inverse_depth
    np.abs(u, out=u)
    np.abs(v, out=v)
    np.maximum(u, v, out=u)
    return u <= inverse_depth


def _paint_round(
    sight: RoundSight,
    texture: Texture,
    light: Light,
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
    shade: Grey = cv2.remap(  # type: ignore[assignment]
        picture, longitude, latitude, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
    )
    light.fall_on(shade, inverse_depth, columns, rows)
    np.copyto(canvas[part], shade, where=visible)
    np.copyto(behind, inverse_depth, where=visible)
