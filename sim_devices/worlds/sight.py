"""A surface as one camera sees it at one moment: where each ray meets it, and what is painted there."""

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.placement import Placement
from sim_devices.worlds.surface import Rectangle, Sphere

NEAR = 1e-4
Array = NDArray[Any]
Affine = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class FlatSight:
    """A rectangle in camera axes.

    On a plane 1/Z, u/Z and v/Z are affine in the ray (X/Z, Y/Z, 1): the rows of ``plane`` give them, with
    (u, v) in metres from the rectangle's centre. ``corners`` is its outline before the near plane.
    """

    surface: Rectangle
    plane: tuple[Affine, Affine, Affine]
    corners: list[Affine]
    nearest: float


@dataclass(frozen=True, eq=False)
class RoundSight:
    """A sphere in camera axes: its centre, and the rotation camera <- body."""

    surface: Sphere
    centre: NDArray[np.float64]
    rotation: NDArray[np.float64]
    nearest: float


Sight = FlatSight | RoundSight


def see(surface: Rectangle | Sphere, body: Placement, camera: Placement) -> Sight | None:
    """The surface in the axes of the camera; None when it is edge-on, turned away or behind."""
    turn = camera.rotation.T
    centre = turn @ (body.position - camera.position)
    rotation = turn @ body.rotation
    if isinstance(surface, Sphere):
        distance = float(np.sqrt(centre @ centre))
        if distance <= surface.radius or centre[2] + surface.radius < NEAR:
            return None
        return RoundSight(surface, centre, rotation, max(distance - surface.radius, NEAR))
    return _see_flat(surface, centre, rotation)


def _see_flat(surface: Rectangle, centre: Array, rotation: Array) -> FlatSight | None:
    (rx, dx, ax), (ry, dy, ay), (rz, dz, az) = rotation.tolist()
    cx, cy, cz = centre.tolist()
    distance = ax * cx + ay * cy + az * cz
    if abs(distance) < 1e-9 or (surface.one_sided and distance < 0.0):
        return None
    half_width, half_height = surface.width / 2.0, surface.height / 2.0
    corners = _before_near(
        [
            (cx + u * rx + v * dx, cy + u * ry + v * dy, cz + u * rz + v * dz)
            for u, v in (
                (-half_width, -half_height),
                (half_width, -half_height),
                (half_width, half_height),
                (-half_width, half_height),
            )
        ]
    )
    if len(corners) < 3:
        return None
    wx, wy, wz = ax / distance, ay / distance, az / distance
    across, along = rx * cx + ry * cy + rz * cz, dx * cx + dy * cy + dz * cz
    plane = (
        (wx, wy, wz),
        (rx - across * wx, ry - across * wy, rz - across * wz),
        (dx - along * wx, dy - along * wy, dz - along * wz),
    )
    return FlatSight(surface, plane, corners, min(corner[2] for corner in corners))


def _before_near(corners: list[Affine]) -> list[Affine]:
    if all(z >= NEAR for _, _, z in corners):
        return corners
    kept = []
    for i, here in enumerate(corners):
        there = corners[(i + 1) % len(corners)]
        if here[2] >= NEAR:
            kept.append(here)
        if (here[2] >= NEAR) != (there[2] >= NEAR):
            s = (NEAR - here[2]) / (there[2] - here[2])
            kept.append((here[0] + s * (there[0] - here[0]), here[1] + s * (there[1] - here[1]), NEAR))
    return kept


def extent(sight: Sight, columns: Array, rows: Array) -> tuple[slice, slice] | None:
    """The rows and columns of samples that can meet the surface; None when none can.

    ``columns`` and ``rows`` are the ascending, evenly spaced ray coordinates of the samples.
    """
    if isinstance(sight, FlatSight):
        across_all = [x / z for x, _, z in sight.corners]
        down_all = [y / z for _, y, z in sight.corners]
        bounds = [(min(across_all), max(across_all)), (min(down_all), max(down_all))]
    else:
        bounds = [_silhouette(sight.centre[[i, 2]], sight.surface.radius) for i in (0, 1)]
    across, down = (_span(bound, axis) for bound, axis in zip(bounds, (columns, rows), strict=True))
    if across is None or down is None:
        return None
    return down, across


def _silhouette(centre: Array, radius: float) -> tuple[float, float]:
    """The two tangents of a circle at (x, z) through the origin, as x/z."""
    x, z = float(centre[0]), float(centre[1])
    a = z * z - radius * radius
    root = x * x + a
    if a <= 0.0 or root <= 0.0:
        return -inf, inf
    half = radius * root**0.5
    return (x * z - half) / a, (x * z + half) / a


def _span(bound: tuple[float, float], axis: Array) -> slice | None:
    count = len(axis)
    first = float(axis[0])
    step = (float(axis[-1]) - first) / (count - 1) if count > 1 else 1.0
    low = (bound[0] - first) / step
    high = (bound[1] - first) / step
    if high < -1.0 or low > count:
        return None
    start = 0 if low < 1.0 else int(low)
    stop = count if high >= count - 1 else int(high) + 2
    return slice(start, stop) if stop > start else None


def pyramid(columns: Array, rows: Array) -> Array:
    """Inward unit normals (5, 3) of the pyramid of rays over ascending axes: left, right, top, bottom, front."""
    left, right, top, bottom = float(columns[0]), float(columns[-1]), float(rows[0]), float(rows[-1])
    normals = np.array(
        [(1.0, 0.0, -left), (-1.0, 0.0, right), (0.0, 1.0, -top), (0.0, -1.0, bottom), (0.0, 0.0, 1.0)]
    )
    sides: Array = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return sides


def over_rays(row: Affine, columns: Array, rows: Array) -> Array:
    """row . (X/Z, Y/Z, 1) over a grid of rays, shape (rows, columns), in the type of the axes."""
    grid: Array = np.add.outer(rows * row[1], columns * row[0] + row[2])
    return grid


def meet_sphere(sight: RoundSight, columns: Array, rows: Array) -> tuple[Array, Array]:
    """Depth Z of the first meeting of each ray (NaN where there is none), and r . r of the rays."""
    x, y, z = (columns.dtype.type(c) for c in sight.centre)
    square = np.add.outer(rows * rows, columns * columns + 1)
    along = np.add.outer(rows * y, columns * x + z)
    beyond = columns.dtype.type(sight.centre @ sight.centre - sight.surface.radius**2)
    discriminant = along * along - square * beyond
    with np.errstate(invalid="ignore"):
        depth = (along - np.sqrt(discriminant)) / square
    return np.where(depth > NEAR, depth, np.nan).astype(columns.dtype, copy=False), square


def sphere_coordinates(sight: RoundSight, depth: Array, columns: Array, rows: Array) -> list[Array]:
    """The points met, on the unit sphere in the body's own axes: three arrays like ``depth``."""
    kind = depth.dtype.type
    offset = (sight.rotation.T @ sight.centre) / sight.surface.radius
    turn = sight.rotation.T / sight.surface.radius
    return [over_rays(tuple(turn[i].tolist()), columns, rows) * depth - kind(offset[i]) for i in range(3)]
