"""The weak string along the scan lines: a smooth disparity with jumps allowed, found by dynamic programming.

Where the membrane (2.15) charges the square of every difference between neighbours, the weak string
(Blake and Zisserman) charges `bend` for one plane and at most `jump` for any number, so that the edge
of an object stays sharp. Its minimum along a line is exact; the four directions are added, as in
semi-global matching (Hirschmüller). The arithmetic is in whole numbers.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Volume = NDArray[np.int16]
Row = NDArray[np.int16]


def jump_costs(guide: NDArray[np.float32], jump: int, least: int, contrast: float) -> tuple[Volume, Volume]:
    """What a jump costs between vertical and between horizontal neighbours: less across an edge of the picture.

    Args:
        guide: the base picture, grey levels.
        contrast: the step in grey levels that halves the cost.

    Returns:
        (height − 1) × width between a row and the next, (width − 1) × height between a column and the next.
    """

    def cost(step: NDArray[np.float32]) -> Volume:
        return np.maximum(jump / (1 + np.abs(step) / np.float32(contrast)), least).astype(np.int16)

    return cost(np.diff(guide, axis=0)), np.ascontiguousarray(cost(np.diff(guide, axis=1)).T)


def sweep_lines(costs: Volume, total: Volume, bend: int, jumps: Volume) -> None:
    """Run the weak string down and up the lines of `costs` (lines × planes × pixels) and put the sum into `total`.

    L_n(k) = c_n(k) + min(L(k), L(k ± 1) + bend, min L + jump) − min L, with L of the line before.
    """
    lines = len(costs)
    best = np.empty(costs.shape[2], np.int16)
    before, after = np.empty_like(costs[0]), np.empty_like(costs[0])
    total[...] = 0
    for order in (range(lines), range(lines - 1, -1, -1)):
        down = order.step == 1
        np.copyto(before, costs[order.start])
        total[order.start] += before
        for n in order[1:]:
            np.minimum.reduce(before, axis=0, out=best)
            np.subtract(before, best, out=before)
            np.minimum(before, jumps[n - 1] if down else jumps[n], out=after)
            np.add(before, np.int16(bend), out=before)
            np.minimum(after[1:], before[:-1], out=after[1:])
            np.minimum(after[:-1], before[1:], out=after[:-1])
            np.add(after, costs[n], out=after)
            np.add(total[n], after, out=total[n])
            before, after = after, before


def aggregate(costs: Volume, bend: int, jumps: tuple[Volume, Volume]) -> Volume:
    """The sum of the four weak strings through every pixel; costs and result height × planes × width."""
    height, count, width = costs.shape
    total = np.empty_like(costs)
    sweep_lines(costs, total, bend, jumps[0])
    across = np.empty((width, count, height), np.int16)
    for k in range(count):
        across[:, k] = cv2.transpose(np.ascontiguousarray(costs[:, k]))
    total_across = np.empty_like(across)
    sweep_lines(across, total_across, bend, jumps[1])
    for k in range(count):
        total[:, k] += np.asarray(cv2.transpose(np.ascontiguousarray(total_across[:, k])), np.int16)
    return total


def choose(total: Volume) -> tuple[Row, NDArray[np.float32]]:
    """The cheapest plane of every pixel, and its place between the planes by a parabola (2.9), (2.10).

    Returns:
        The number of the plane and the place in planes (height × width each).
    """
    height, count, width = total.shape
    least = total[:, 0].copy()
    plane = np.zeros((height, width), np.int16)
    for k in range(1, count):
        less = total[:, k] < least
        np.copyto(least, total[:, k], where=less)
        np.copyto(plane, k, where=less)
    middle = np.clip(plane, 1, count - 2).astype(np.intp)
    place = (np.arange(height)[:, None] * count + middle) * width + np.arange(width)[None, :]
    below, here, above = (np.take(total, place + step).astype(np.float32) for step in (-width, 0, width))
    curvature = below - 2 * here + above
    offset = np.where(
        (plane == middle) & (curvature > 0), 0.5 * (below - above) / np.maximum(curvature, 1), 0
    )
    return plane, (plane + np.clip(offset, -0.5, 0.5)).astype(np.float32)
