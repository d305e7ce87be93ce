"""The floor of a plan with its pits, and the ceiling."""

from collections.abc import Iterator
from itertools import pairwise
from math import atan2, hypot, pi

from sim_devices.worlds.paint import Painter
from sim_devices.worlds.placement import facing, still
from sim_devices.worlds.plan import Hole, Plan, TextureConfig
from sim_devices.worlds.surface import Rectangle

Area = tuple[float, float, float, float]
"""From x to x, from y to y."""
_MARGIN = 6.0


def ground(plan: Plan, painter: Painter) -> Iterator[Rectangle]:
    """What is left of the floor between the holes, the pits under them, and the ceiling."""
    area = _area(plan)
    if plan.floor is not None:
        holes = [_outline(hole) for hole in plan.floor.hole]
        for part in _around(area, holes):
            yield _level(part, 0.0, plan.floor.texture, painter)
        for hole, part in zip(plan.floor.hole, holes, strict=True):
            yield _level(part, -hole.depth, hole.texture, painter)
            yield from _sides(part, hole, painter)
    if plan.ceiling is not None:
        yield _level(area, plan.ceiling.height, plan.ceiling.texture, painter)


def _area(plan: Plan) -> Area:
    """Everything that stands, the start, and a margin."""
    points = [(0.0, 0.0), *(p for wall in plan.wall for p in wall.points), *((b.x, b.y) for b in plan.box)]
    x, y = [p[0] for p in points], [p[1] for p in points]
    return min(x) - _MARGIN, max(x) + _MARGIN, min(y) - _MARGIN, max(y) + _MARGIN


def _outline(hole: Hole) -> Area:
    return (
        hole.x - hole.length / 2.0,
        hole.x + hole.length / 2.0,
        hole.y - hole.width / 2.0,
        hole.y + hole.width / 2.0,
    )


def _around(area: Area, holes: list[Area]) -> Iterator[Area]:
    """The area without the holes: strips across x, cut along y."""
    x1, x2, y1, y2 = area
    cuts = sorted({x1, x2, *(x for hole in holes for x in hole[:2] if x1 < x < x2)})
    for low, high in pairwise(cuts):
        reached = y1
        for hole in sorted((h for h in holes if h[0] <= low and high <= h[1]), key=lambda h: h[2]):
            if hole[2] > reached:
                yield low, high, reached, min(hole[2], y2)
            reached = max(reached, hole[3])
        if reached < y2:
            yield low, high, reached, y2


def _level(area: Area, z: float, texture: TextureConfig | None, painter: Painter) -> Rectangle:
    """A level picture, seen upright from a low place behind it by who looks along x; its pattern is the plan's."""
    x1, x2, y1, y2 = area
    size = y2 - y1, x2 - x1
    place = facing(((x1 + x2) / 2.0, (y1 + y2) / 2.0, z), 0.0, pi / 2.0)
    return Rectangle(*size, painter(texture, size, (-y2, -x2)), still(place))


def _sides(area: Area, hole: Hole, painter: Painter) -> Iterator[Rectangle]:
    x1, x2, y1, y2 = area
    corners = [(x1, y1), (x2, y1), (x2, y2), (x1, y2), (x1, y1)]
    for (ax, ay), (bx, by) in pairwise(corners):
        size = hypot(bx - ax, by - ay), hole.depth
        place = facing(
            ((ax + bx) / 2.0, (ay + by) / 2.0, -hole.depth / 2.0), atan2(by - ay, bx - ax) + pi / 2.0
        )
        yield Rectangle(*size, painter(hole.texture, size, painter.anywhere(hole.texture)), still(place))
