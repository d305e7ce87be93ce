"""The true way of two wheels: what the base believes that they rolled, against what the floor saw."""

from math import acos, inf, sin

from sim_devices.labmate.config import BaseConfig, Wheel

WHEEL_RADIUS = 0.075
"""Ours: the page gives none. A 10 mm bump then costs 3.5 mm of way, which turns the heading 0.6°."""


class WheelOnFloor:
    """True way of one wheel as a function of the way that it rolled by its nominal diameter, metres.

    Proportional, less what bumps and slips took: each a stretch of rolled way of which a part is lost.
    """

    def __init__(self, scale: float) -> None:
        self.rolled = 0.0
        self._scale = scale
        self._offset = 0.0
        self._losses: list[tuple[float, float, float]] = []

    def even_way(self) -> float:
        """Return the way that can be rolled before a loss begins or ends; 0 inside one."""
        even = inf
        for begin, end, _ in self._losses:
            even = min(even, max(begin - self.rolled, self.rolled - end, 0.0))
        return even

    def true_way(self) -> float:
        """Return the way over the floor at the present rolled way."""
        way = self._offset + self._scale * self.rolled
        for begin, end, part in self._losses:
            way -= part * (min(max(self.rolled, begin), end) - begin)
        return way

    def add_bump(self, at: float, height: float, sign: int) -> None:
        """Place a round bump, from the rolled way `at` on in the direction of sign.

        The wheel pivots over it by φ = arccos(1 − h/R), up and down again: it rolls 2 R φ and comes
        2 R sin φ on.
        """
        angle = acos(1 - height / WHEEL_RADIUS)
        self._lose(at, sign * 2 * WHEEL_RADIUS * angle, 1 - sin(angle) / angle)

    def add_slip(self, distance: float, sign: int) -> None:
        """Let the wheel spin on the spot for a distance (m) from now on."""
        self._lose(self.rolled, sign * distance, 1.0)

    def _lose(self, begin: float, length: float, part: float) -> None:
        before = self.true_way()
        first, last = sorted((begin, begin + length))
        self._losses.append((first, last, part * self._scale))
        # A stretch at smaller ways counts as passed: the wheel itself must not jump.
        self._offset += before - self.true_way()


def wheels_of(config: BaseConfig) -> dict[Wheel, WheelOnFloor]:
    """Return both wheels: diameters in the given ratio about the nominal one, bumps and slip as configured."""
    ratio = config.diameter_ratio
    wheels: dict[Wheel, WheelOnFloor] = {
        "left": WheelOnFloor(2 / (1 + ratio) * (1 - config.slip_left)),
        "right": WheelOnFloor(2 * ratio / (1 + ratio) * (1 - config.slip_right)),
    }
    for bump in config.bumps:
        wheels[bump.wheel].add_bump(bump.at, bump.height, 1)
    return wheels
