"""How a person of a plan walks: along a line of points at one speed."""

from bisect import bisect_right
from itertools import accumulate, pairwise
from math import atan2, hypot, pi

from sim_devices.worlds.plan import Person


class Walk:
    """Place and heading of a person at a time since the world's start."""

    def __init__(self, person: Person) -> None:
        self._person = person
        steps = [(x2 - x1, y2 - y1) for (x1, y1), (x2, y2) in pairwise(person.path)]
        self._headings = [atan2(dy, dx) for dx, dy in steps]
        self._ways = [0.0, *accumulate(hypot(dx, dy) for dx, dy in steps)]

    def at(self, t: float) -> tuple[float, float, float]:
        """x, y (m) and heading (rad) after ``t`` seconds."""
        person, length = self._person, self._ways[-1]
        way, back = person.speed * max(0.0, t - person.start), False
        if person.back_and_forth:
            way %= 2.0 * length
            back = way > length
            way = 2.0 * length - way if back else way
        way = min(way, length)
        n = min(bisect_right(self._ways, way), len(self._headings)) - 1
        part = (way - self._ways[n]) / (self._ways[n + 1] - self._ways[n])
        (x1, y1), (x2, y2) = person.path[n : n + 2]
        heading = self._headings[n] + (pi if back else 0.0)
        return x1 + part * (x2 - x1), y1 + part * (y2 - y1), heading
