"""The floor plan about a base: walls, boxes, and how far the body is from them."""

from collections.abc import Callable, Iterable
from math import cos, hypot, inf, radians, sin
from typing import NamedTuple

from sim_devices.labmate.config import BaseConfig, Box

Segment = tuple[float, float, float, float]


class Rectangle(NamedTuple):
    """A rectangle along the body's axes: x forward, y left, metres."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    def distance_to(self, segment: Segment) -> float:
        """Return the distance to a segment in the body's axes; 0 when they touch."""
        x1, y1, x2, y2 = segment
        if self._crosses(x1, y1, x2, y2):
            return 0.0
        distance = min(self._point(x1, y1), self._point(x2, y2))
        dx, dy = x2 - x1, y2 - y1
        square = dx * dx + dy * dy
        if square > 0:
            for x in (self.x_min, self.x_max):
                for y in (self.y_min, self.y_max):
                    along = min(max(((x - x1) * dx + (y - y1) * dy) / square, 0.0), 1.0)
                    distance = min(distance, hypot(x1 + along * dx - x, y1 + along * dy - y))
        return distance

    def _point(self, x: float, y: float) -> float:
        return hypot(max(self.x_min - x, 0.0, x - self.x_max), max(self.y_min - y, 0.0, y - self.y_max))

    def _crosses(self, x1: float, y1: float, x2: float, y2: float) -> bool:
        """Clip the segment to the rectangle (Liang and Barsky)."""
        enter, leave = 0.0, 1.0
        for start, way, low, high in (
            (x1, x2 - x1, self.x_min, self.x_max),
            (y1, y2 - y1, self.y_min, self.y_max),
        ):
            if way == 0:
                if not low <= start <= high:
                    return False
                continue
            first, last = sorted(((low - start) / way, (high - start) / way))
            enter, leave = max(enter, first), min(leave, last)
            if enter > leave:
                return False
        return True


def box_segments(box: Box) -> list[Segment]:
    """Return a box's outline and its diagonals: a body smaller than the box cannot be inside it unnoticed."""
    c, s = cos(radians(box.yaw_deg)), sin(radians(box.yaw_deg))
    corners = [
        (
            box.x + c * u * box.length / 2 - s * v * box.width / 2,
            box.y + s * u * box.length / 2 + c * v * box.width / 2,
        )
        for u, v in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    ]
    pairs = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)]
    return [(*corners[a], *corners[b]) for a, b in pairs]


class Walker(NamedTuple):
    """Somebody who walks about: where he stands at a time, and the speed that he keeps to (m/s).

    He presses bumpers and gives way to the frame.
    """

    outline: Callable[[float], Box]
    top_speed: float


class Surroundings(NamedTuple):
    """What is about a body, in its axes: `high` meets the bumpers, `low` only the frame, `soft` only bumpers."""

    high: list[Segment]
    low: list[Segment]
    soft: list[Segment]


class Floor:
    """Walls, boxes and people; `low` boxes pass under the bumpers."""

    def __init__(self, walls: Iterable[Segment] = (), boxes: Iterable[Box] = ()) -> None:
        self._high = list(walls)
        self._low: list[Segment] = []
        self.walkers: list[Walker] = []
        for box in boxes:
            self.add(box)

    @property
    def empty(self) -> bool:
        """Whether there is nothing to run into."""
        return not self._high and not self._low and not self.walkers

    @property
    def top_speed(self) -> float:
        """No obstacle moves faster, m/s."""
        return max((walker.top_speed for walker in self.walkers), default=0.0)

    def add(self, box: Box) -> None:
        """Put a box down."""
        (self._low if box.low else self._high).extend(box_segments(box))

    def clear(self) -> None:
        """Take every wall and box away."""
        self._high.clear()
        self._low.clear()

    def seen_from(self, x: float, y: float, heading: float, t: float) -> Surroundings:
        """Return what is there at a time in the axes of a body at a pose."""
        c, s = cos(heading), sin(heading)

        def turned(segment: Segment) -> Segment:
            x1, y1, x2, y2 = segment
            u1, v1, u2, v2 = x1 - x, y1 - y, x2 - x, y2 - y
            return c * u1 + s * v1, c * v1 - s * u1, c * u2 + s * v2, c * v2 - s * u2

        soft = [segment for walker in self.walkers for segment in box_segments(walker.outline(t))]
        return Surroundings(
            *([turned(segment) for segment in part] for part in (self._high, self._low, soft))
        )


class Contact(NamedTuple):
    """How a body stands to its surroundings, metres; 0 is touching."""

    bumpers: tuple[float, float, float, float]
    """Front, rear, left, right."""
    frame: float
    """What no bumper covers any more: nothing goes nearer than 0."""


class Outline:
    """The body's rectangle: a frame with a strip of bumper on each side, the corners being front or rear."""

    def __init__(self, config: BaseConfig) -> None:
        x, y, travel = config.length / 2, config.width / 2, config.bumper_travel
        self.radius = hypot(x, y)
        self._travel = travel
        self._hull = Rectangle(-x, x, -y, y)
        self._frame = Rectangle(-x + travel, x - travel, -y + travel, y - travel)
        self._bumpers = (
            Rectangle(x - travel, x, -y, y),
            Rectangle(-x, -x + travel, -y, y),
            Rectangle(-x + travel, x - travel, y - travel, y),
            Rectangle(-x + travel, x - travel, -y, -y + travel),
        )

    def contact(self, floor: Floor, x: float, y: float, heading: float, t: float) -> Contact:
        """Return the distances at a pose and a time; the bumpers' are equal while the hull is clear."""
        high, low, soft = floor.seen_from(x, y, heading, t)
        hull = _least(self._hull, high + soft)
        if hull > 0:
            return Contact((hull, hull, hull, hull), min(hull + self._travel, _least(self._frame, low)))
        front, rear, left, right = (_least(bumper, high + soft) for bumper in self._bumpers)
        return Contact((front, rear, left, right), _least(self._frame, high + low))

    def clearance(self, floor: Floor, x: float, y: float, heading: float, t: float) -> float:
        """Return how far the whole body is from everything; infinite when there is nothing."""
        high, low, soft = floor.seen_from(x, y, heading, t)
        return _least(self._hull, high + low + soft)


def _least(rectangle: Rectangle, segments: list[Segment]) -> float:
    return min((rectangle.distance_to(segment) for segment in segments), default=inf)
