"""What became of a GO or a TURN."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, degrees, sin

from labmate.base.driver import Kind
from labmate.base.events import Bumper, Cause
from labmate.odometry import Pose


@dataclass(frozen=True, slots=True)
class MotionReport:
    """How a GO (m) or TURN (rad) ended; poses are the base's own, `travelled` is along them."""

    kind: Kind
    commanded: float
    travelled: float
    ending: Cause
    bumper: Bumper
    start: Pose
    end: Pose
    duration: float

    @property
    def reason(self) -> str:
        """What ended it, in words."""
        if self.ending is Cause.BUMPER and self.bumper:
            return f"{self.bumper.words} bumper"
        return self.ending.value

    def __str__(self) -> str:
        if self.kind == "GO":
            asked, done = f"{self.commanded:.3f} m", f"{self.travelled:.3f} m"
        else:
            asked, done = f"{degrees(self.commanded):.2f}°", f"{degrees(self.travelled):.2f}°"
        if self.ending is Cause.REACHED:
            return f"{self.kind} {asked}: reached {done}"
        return f"{self.kind} {asked} ended after {done}: {self.reason}"


def travelled(kind: Kind, start: Pose, end: Pose) -> float:
    """Return the way along the starting heading (m) or the turned angle (rad)."""
    if kind == "TURN":
        return end.heading - start.heading
    return (end.x - start.x) * cos(start.heading) + (end.y - start.y) * sin(start.heading)
