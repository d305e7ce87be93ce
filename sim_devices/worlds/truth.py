"""The exact depth and motion of what a rendered picture shows, at the pixel centres, in double precision."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.optics import Optics, Window
from sim_devices.worlds.placement import Placement
from sim_devices.worlds.sight import FlatSight, extent, meet_sphere, over_rays, see, sphere_coordinates
from sim_devices.worlds.surface import Surface, texture_at
from sim_devices.worlds.world import World

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Hits:
    """What each pixel's central ray meets first.

    ``surface`` (height, width): index into the world's surfaces, -1 for none. ``depth`` (height, width): Z
    along the optical axis, metres, NaN for none. ``body`` (height, width, 3): the point in that surface's
    own frame.
    """

    surface: NDArray[np.intp]
    depth: Array
    body: Array


def meet(world: World, optics: Optics, camera: Placement, t: float, window: Window | None = None) -> Hits:
    """Where the rays of ``window`` end at time ``t``."""
    window = optics.whole if window is None else window
    optics.check(window)
    t = world.elapsed(t)
    columns, rows = optics.rays(window)
    shape = (window.height, window.width)
    which = np.full(shape, -1, np.intp)
    depth = np.full(shape, np.inf)
    body = np.full((*shape, 3), np.nan)
    for index, surface in enumerate(world.surfaces):
        sight = None if texture_at(surface, t) is None else see(surface, surface.motion(t), camera)
        part = None if sight is None else extent(sight, columns, rows)
        if sight is None or part is None:
            continue
        x, y = columns[part[1]], rows[part[0]]
        if isinstance(sight, FlatSight):
            here, point = _meet_flat(sight, x, y)
        else:
            here, _ = meet_sphere(sight, x, y)
            point = np.stack(sphere_coordinates(sight, here, x, y), axis=-1) * sight.surface.radius
        nearer = here < depth[part]
        which[part][nearer] = index
        depth[part][nearer] = here[nearer]
        body[part][nearer] = point[nearer]
    return Hits(which, np.where(which < 0, np.nan, depth), body)


def depth_map(
    world: World, optics: Optics, camera: Placement, t: float, window: Window | None = None
) -> Array:
    """Exact Z of every pixel's central ray, metres (height, width); NaN where it meets nothing."""
    return meet(world, optics, camera, t, window).depth


def flow_map(
    world: World,
    optics: Optics,
    before: tuple[Placement, float],
    after: tuple[Placement, float],
    window: Window | None = None,
) -> Array:
    """Exact displacement in pixels (height, width, 2) of what is seen ``before`` until ``after``.

    Each is (placement of the camera, time). A point that is hidden or out of the image afterwards still has
    its displacement; NaN where nothing is seen or the point ends behind the camera.
    """
    window = optics.whole if window is None else window
    hits = meet(world, optics, before[0], before[1], window)
    camera = after[0].inverse()
    flow = np.full((*hits.depth.shape, 2), np.nan)
    for index, surface in enumerate(world.surfaces):
        here = hits.surface == index
        if here.any():
            to_camera = camera @ surface.motion(world.elapsed(after[1]))
            flow[here] = optics.project(hits.body[here] @ to_camera.rotation.T + to_camera.position)
    columns = np.arange(window.width) + window.left
    rows = np.arange(window.height) + window.top
    flow[..., 0] -= columns
    flow[..., 1] -= rows[:, None]
    return flow


def pixel_of(world: World, surface: Surface, optics: Optics, camera: Placement, t: float) -> Array:
    """Pixel (x, y) of the surface's own origin, whether or not something hides it; NaN behind the camera."""
    return optics.project((camera.inverse() @ surface.motion(world.elapsed(t))).position)


def _meet_flat(sight: FlatSight, columns: Array, rows: Array) -> tuple[Array, Array]:
    inverse_depth = over_rays(sight.plane[0], columns, rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(inverse_depth > 0.0, 1.0 / inverse_depth, np.inf)
        u = over_rays(sight.plane[1], columns, rows) * depth
        v = over_rays(sight.plane[2], columns, rows) * depth
    across, along = u * (2.0 / sight.surface.width), v * (2.0 / sight.surface.height)
    with np.errstate(invalid="ignore"):
        if sight.surface.elliptic:
            inside = across**2 + along**2 <= 1.0
        else:
            inside = np.maximum(np.abs(across), np.abs(along)) <= 1.0
    return np.where(inside, depth, np.inf), np.stack([u, v, np.zeros_like(u)], axis=-1)
