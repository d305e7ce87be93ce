"""Scanline aggregation with the penalties P1 and P2: a smooth disparity with discontinuities, by dynamic programming.

Where the membrane (2.15) charges the square of every difference between neighbours, semi-global matching
(Hirschmüller) charges P1 for one plane and P2 for any number, so that the edge of an object stays sharp. The minimum
along one path is exact; the paths of four directions, two along the rows and two along the columns, are added. The
arithmetic is in whole numbers.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.image.bands import Band, bands, join_bands, share

Costs = NDArray[np.uint8]
"""Costs of single pixels, and what one path adds up to: at most the greatest cost and P2."""
Volume = NDArray[np.int16]
"""Sums of four paths, planes × height × width."""
Planes = NDArray[np.int16]
"""Numbers of planes, height × width."""


def adapt_p2(guide: NDArray[np.float32], p2: int, least: int, contrast: float) -> tuple[Costs, Costs]:
    """P2 between vertical and between horizontal neighbours: less across an edge of the image.

    Args:
        guide: the base image, height × width, grey levels.
        p2: the penalty where the image is even.
        least: what it falls to.
        contrast: the step in grey levels that halves it.

    Returns:
        (height − 1) × width between a row and the next, (width − 1) × height between a column and the next.
    """

    def penalty(step: NDArray[np.float32]) -> Costs:
        return np.maximum(p2 / (1 + np.abs(step) / np.float32(contrast)), least).astype(np.uint8)

    return penalty(np.diff(guide, axis=0)), np.ascontiguousarray(penalty(np.diff(guide, axis=1)).T)


def aggregate_lines(paths: Costs, p1: int, p2: Costs) -> None:
    """Aggregate along two opposite directions at once, down and up the lines, in place.

    L_n(k) = c_n(k) + min(L(k), L(k ± 1) + P1, min L + P2) − min L, with L of the line before.

    Args:
        paths: lines × planes × 2 × pixels: the costs from the first line to the last, and from the last to the
            first. A cost and P2 must fit a byte together.
        p1: P1.
        p2: (lines − 1) × pixels, between each line and the next.
    """
    both_p2 = np.stack((p2, p2[::-1]), axis=1)
    one = np.uint8(p1)
    # What the calls cost is mostly the calling: few of them, on long rows, and none that makes an array.
    best, level, raised = np.empty_like(paths[0, 0]), np.empty_like(paths[0]), np.empty_like(paths[0])
    upper, lower, raised_upper, raised_lower = level[1:], level[:-1], raised[1:], raised[:-1]
    before = paths[0]
    for now, many in zip(paths[1:], both_p2, strict=True):
        np.minimum.reduce(before, axis=0, out=best)
        np.subtract(before, best, out=level)
        # P2 first, so that adding P1 cannot overflow.
        np.minimum(level, many, out=level)
        np.add(level, one, out=raised)
        np.minimum(upper, raised_lower, out=upper)
        np.minimum(lower, raised_upper, out=lower)
        np.add(now, level, out=now)
        before = now


def aggregate(costs: Costs, p1: int, p2: tuple[Costs, Costs]) -> Volume:
    """The sum of the four paths through every pixel; costs and result planes × height × width."""
    count, height, width = costs.shape
    total = np.empty(costs.shape, np.int16)
    # The paths along the rows take the memory of those along the columns once these are added up.
    memory = np.empty(2 * costs.size, np.uint8)
    paths = memory.reshape(height, count, 2, width)

    def lay(k: int) -> None:
        paths[:, k, 0] = costs[k]
        paths[:, k, 1] = costs[k, ::-1]

    def lay_turned(k: int) -> None:
        turned = cv2.transpose(costs[k])
        paths[:, k, 0] = turned
        paths[:, k, 1] = turned[::-1]

    def add(k: int) -> None:
        np.add(paths[:, k, 0], paths[::-1, k, 1], out=total[k], dtype=np.int16)

    def add_turned(k: int) -> None:
        total[k] += cv2.transpose(np.add(paths[:, k, 0], paths[::-1, k, 1], dtype=np.int16))

    pixels = height * width
    share(lay, range(count), pixels)
    aggregate_lines(paths, p1, p2[0])
    share(add, range(count), pixels)
    paths = memory.reshape(width, count, 2, height)
    share(lay_turned, range(count), pixels)
    aggregate_lines(paths, p1, p2[1])
    share(add_turned, range(count), pixels)
    return total


def blend_costs(costs: Costs, total: Volume, most: int) -> Costs:
    """Half the costs and half what the paths made of them, min(¼(S − min S), most): costs for a second aggregation.

    A path depends on its own line alone. In noise the lines disagree and the map is streaked; paths that run a second
    time, over these costs, take in at every pixel the paths that cross there, and so the lines beside their own.

    Args:
        costs: planes × height × width.
        total: what `aggregate` made of them.
        most: the greatest cost that results.
    """
    mixed = np.empty_like(costs)

    def mix(band: Band) -> None:
        for row in range(band.inner.start, band.inner.stop):
            aggregated = total[:, row] - np.minimum.reduce(total[:, row], axis=0)
            aggregated >>= 2
            np.minimum(aggregated, np.int16(most), out=aggregated)
            aggregated += costs[:, row]
            aggregated >>= 1
            np.copyto(mixed[:, row], aggregated, casting="unsafe")

    _, height, width = costs.shape
    share(mix, bands((height, width)), height * width)
    return mixed


def choose(total: Volume) -> tuple[Planes, NDArray[np.float32]]:
    """The cheapest plane of every pixel, and its place between the planes by a parabola (2.9), (2.10).

    Returns:
        The number of the plane and the place in planes (height × width each).
    """
    count, height, width = total.shape

    def search(band: Band) -> tuple[Planes, NDArray[np.float32]]:
        plane = cheapest(total[:, band.inner])
        middle = np.clip(plane, 1, count - 2)
        place, flat = _places(total, middle, band.inner.start), total.reshape(-1)
        below, here, above = (
            np.take(flat, place + step * height * width).astype(np.float32) for step in (-1, 0, 1)
        )
        curvature = below - 2 * here + above
        offset = np.float32(0.5) * (below - above) / np.maximum(curvature, np.float32(1))
        offset *= (plane == middle) & (curvature > 0)
        return plane, plane + np.clip(offset, np.float32(-0.5), np.float32(0.5))

    plane, place = join_bands((height, width), search)
    return plane, place


def cheapest(costs: Volume) -> Planes:
    """The number of the cheapest plane, the first of equals; costs planes × height × width, result height × width."""
    least: Planes = np.minimum.reduce(costs, axis=0)
    plane, number = np.zeros_like(least), np.empty_like(least)
    for k in range(len(costs) - 1, -1, -1):
        number.fill(k)
        cv2.copyTo(number, (costs[k] == least).view(np.uint8), plane)
    return plane


def pick(volume: NDArray[Any], plane: Planes, top: int = 0) -> NDArray[Any]:
    """What a volume (planes × height × width) holds on each pixel's own plane, for the rows from `top` on."""
    return np.take(volume.reshape(-1), _places(volume, plane, top))


def _places(volume: NDArray[Any], plane: Planes, top: int) -> NDArray[np.intp]:
    _, height, width = volume.shape
    index = plane.astype(np.intp)
    index *= height * width
    index += np.arange(top * width, top * width + plane.size).reshape(plane.shape)
    return index
