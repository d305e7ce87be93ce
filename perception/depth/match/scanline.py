"""The weak string along the scan lines: a smooth disparity with jumps allowed, found by dynamic programming.

Where the membrane (2.15) charges the square of every difference between neighbours, the weak string
(Blake and Zisserman) charges `bend` for one plane and at most `jump` for any number, so that the edge
of an object stays sharp. Its minimum along a line is exact; the four directions are added, as in
semi-global matching (Hirschmüller). The arithmetic is in whole numbers.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.image.bands import Band, bands, join_bands, share

Costs = NDArray[np.uint8]
"""Costs of single pixels, and what one string adds up to: at most the greatest cost and a jump."""
Volume = NDArray[np.int16]
"""Sums of four strings, planes × height × width."""
Planes = NDArray[np.int16]


def jump_costs(guide: NDArray[np.float32], jump: int, least: int, contrast: float) -> tuple[Costs, Costs]:
    """What a jump costs between vertical and between horizontal neighbours: less across an edge of the picture.

    Args:
        guide: the base picture, grey levels.
        contrast: the step in grey levels that halves the cost.

    Returns:
        (height − 1) × width between a row and the next, (width − 1) × height between a column and the next.
    """

    def cost(step: NDArray[np.float32]) -> Costs:
        return np.maximum(jump / (1 + np.abs(step) / np.float32(contrast)), least).astype(np.uint8)

    return cost(np.diff(guide, axis=0)), np.ascontiguousarray(cost(np.diff(guide, axis=1)).T)


def sweep_lines(strings: Costs, bend: int, jumps: Costs) -> None:
    """Run two weak strings at once, one down and one up the lines, in place.

    L_n(k) = c_n(k) + min(L(k), L(k ± 1) + bend, min L + jump) − min L, with L of the line before.

    Args:
        strings: lines × planes × 2 × pixels: the costs from the first line to the last, and from the last to the
            first. A cost and a jump must fit a byte together.
        jumps: (lines − 1) × pixels, between each line and the next.
    """
    both_jumps = np.stack((jumps, jumps[::-1]), axis=1)
    step = np.uint8(bend)
    # What the calls cost is mostly the calling: few of them, on long rows, and none that makes an array.
    best, level, bent = np.empty_like(strings[0, 0]), np.empty_like(strings[0]), np.empty_like(strings[0])
    upper, lower, bent_upper, bent_lower = level[1:], level[:-1], bent[1:], bent[:-1]
    before = strings[0]
    for now, jump in zip(strings[1:], both_jumps, strict=True):
        np.minimum.reduce(before, axis=0, out=best)
        np.subtract(before, best, out=level)
        # The jump first, so that the bend cannot overflow.
        np.minimum(level, jump, out=level)
        np.add(level, step, out=bent)
        np.minimum(upper, bent_lower, out=upper)
        np.minimum(lower, bent_upper, out=lower)
        np.add(now, level, out=now)
        before = now


def aggregate(costs: Costs, bend: int, jumps: tuple[Costs, Costs]) -> Volume:
    """The sum of the four weak strings through every pixel; costs and result planes × height × width."""
    count, height, width = costs.shape
    total = np.empty(costs.shape, np.int16)
    # The strings along the rows take the room of those along the columns once these are added up.
    room = np.empty(2 * costs.size, np.uint8)
    strings = room.reshape(height, count, 2, width)

    def lay(k: int) -> None:
        strings[:, k, 0] = costs[k]
        strings[:, k, 1] = costs[k, ::-1]

    def lay_turned(k: int) -> None:
        turned = cv2.transpose(costs[k])
        strings[:, k, 0] = turned
        strings[:, k, 1] = turned[::-1]

    def add(k: int) -> None:
        np.add(strings[:, k, 0], strings[::-1, k, 1], out=total[k], dtype=np.int16)

    def add_turned(k: int) -> None:
        total[k] += cv2.transpose(np.add(strings[:, k, 0], strings[::-1, k, 1], dtype=np.int16))

    pixels = height * width
    share(lay, range(count), pixels)
    sweep_lines(strings, bend, jumps[0])
    share(add, range(count), pixels)
    strings = room.reshape(width, count, 2, height)
    share(lay_turned, range(count), pixels)
    sweep_lines(strings, bend, jumps[1])
    share(add_turned, range(count), pixels)
    return total


def hear_neighbours(costs: Costs, total: Volume, most: int) -> Costs:
    """Half the costs and half what the strings made of them, min(¼(S − min S), most).

    A string knows only its own line. In noise the lines disagree and the map is streaked; strings that run a
    second time, over these costs, hear through every pixel the strings that cross there, and so the lines beside
    their own.
    """
    mixed = np.empty_like(costs)

    def mix(band: Band) -> None:
        for row in range(band.inner.start, band.inner.stop):
            heard = total[:, row] - np.minimum.reduce(total[:, row], axis=0)
            heard >>= 2
            np.minimum(heard, np.int16(most), out=heard)
            heard += costs[:, row]
            heard >>= 1
            np.copyto(mixed[:, row], heard, casting="unsafe")

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
    """What a volume (planes × height × width) holds on one plane for every pixel of the rows from `top` on."""
    return np.take(volume.reshape(-1), _places(volume, plane, top))


def _places(volume: NDArray[Any], plane: Planes, top: int) -> NDArray[np.intp]:
    _, height, width = volume.shape
    index = plane.astype(np.intp)
    index *= height * width
    index += np.arange(top * width, top * width + plane.size).reshape(plane.shape)
    return index
