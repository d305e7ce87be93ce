"""What a base reports on its own, and the words for it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, Flag, auto
from math import inf

from labmate.errors import MotionStopped
from labmate.odometry import Pose
from medusa.errors import DeviceRestarted, HostGap, MedusaError


class Cause(Enum):
    """What ended a motion; all but the first two stop the base by themselves."""

    REACHED = "reached"
    STOP = "stop"
    BUMPER = "bumper"
    EMERGENCY_STOP = "emergency stop"
    STALLED = "stalled"
    WATCHDOG = "watchdog"
    LOST = "line lost"
    RESTARTED = "restart"


class Bumper(Flag):
    """Sides on which a base can be touched."""

    FRONT = auto()
    REAR = auto()
    LEFT = auto()
    RIGHT = auto()

    @property
    def words(self) -> str:
        """Names of the sides."""
        return " and ".join(side.name.lower() for side in self if side.name)


UNTOUCHED = Bumper(0)


@dataclass(frozen=True, slots=True)
class Stopped:
    """The base stopped by itself at the machine's own time `stamp`, s.

    `error` where it is more than that: a lost line, a restart, a gap in feeding its watchdog. Then no motion is
    possible before the driver is opened again.
    """

    cause: Cause
    stamp: float
    touching: Bumper = UNTOUCHED
    error: MedusaError | None = None

    @classmethod
    def lost(cls, error: MedusaError) -> Stopped:
        """Return what a lost line, a restart or a gap in feeding the watchdog is, now."""
        causes = {DeviceRestarted: Cause.RESTARTED, HostGap: Cause.WATCHDOG}
        return cls(causes.get(type(error), Cause.LOST), inf, error=error)

    def ending(self) -> MotionStopped:
        """Return the error with which it ends a motion under way."""
        stopped = MotionStopped(f"the motion ended: {self.words}", reason=self.cause.value)
        stopped.__cause__ = self.error
        return stopped

    @property
    def words(self) -> str:
        """What happened, as a sentence's end."""
        if self.error is not None:
            return str(self.error)
        if self.cause is Cause.BUMPER:
            return (
                f"the {self.touching.words} bumper was pressed" if self.touching else "a bumper was pressed"
            )
        known = {
            Cause.EMERGENCY_STOP: "emergency stop",
            Cause.STALLED: "the wheels stalled",
            Cause.WATCHDOG: "the base's watchdog expired",
        }
        return known.get(self.cause, str(self.cause.value))


@dataclass(frozen=True, slots=True)
class TravelEnded:
    """A GO or TURN ended, the base is at rest; `pose` is the base's own (`BaseReading.own_pose`)."""

    cause: Cause
    pose: Pose
    stamp: float


@dataclass(frozen=True, slots=True)
class LowBattery:
    """The battery is low: no new GO is begun."""

    stamp: float


Event = Stopped | TravelEnded | LowBattery
