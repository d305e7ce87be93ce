"""The truth about a base in a plan, out of band: for tests and reports, never for what drives it."""

from dataclasses import dataclass
from itertools import pairwise
from math import hypot, inf

from sim_devices.labmate import BaseMachine
from sim_devices.obstacles import pits
from sim_devices.worlds.plan import Plan, Point


@dataclass(frozen=True)
class Truth:
    """Where the base is at a time: metres, radians, in the plan's axes.

    ``clearance`` from the whole body to the nearest wall, box, person or hole, 0 when it touches; whether it
    has touched anything until now; ``off_middle`` from the plan's middle, positive left of it (None without
    one); whether its centre is ``past_goal`` (None without a goal).
    """

    time: float
    x: float
    y: float
    heading: float
    clearance: float
    touched: bool
    off_middle: float | None
    past_goal: bool | None


class Witness:
    """Knows where a base is and how near it came; asked in the order of time, not about the past."""

    def __init__(self, machine: BaseMachine, plan: Plan) -> None:
        self._machine = machine
        self._plan = plan
        self._pits = pits(plan)

    def at(self, t: float) -> Truth:
        """The truth at ``t``; the base is advanced until then."""
        x, y, heading = self._machine.pose(t)
        middle, goal = self._plan.middle, self._plan.goal
        return Truth(
            time=t,
            x=x,
            y=y,
            heading=heading,
            clearance=min(self._machine.clearance(t), self._machine.clearance(t, self._pits)),
            touched=self._machine.touched_at is not None,
            off_middle=None if middle is None else _off_line(middle, x, y),
            past_goal=None if goal is None else _past(goal, x, y),
        )


def _off_line(line: list[Point], x: float, y: float) -> float:
    """Distance to a line of points, positive left of it."""
    nearest = inf
    for (x1, y1), (x2, y2) in pairwise(line):
        dx, dy = x2 - x1, y2 - y1
        part = min(max(((x - x1) * dx + (y - y1) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        distance = hypot(x - x1 - part * dx, y - y1 - part * dy)
        if distance < abs(nearest):
            nearest = distance if dx * (y - y1) - dy * (x - x1) >= 0.0 else -distance
    return nearest


def _past(goal: tuple[Point, Point], x: float, y: float) -> bool:
    (left_x, left_y), (right_x, right_y) = goal
    return (x - left_x) * (left_y - right_y) + (y - left_y) * (right_x - left_x) > 0.0
