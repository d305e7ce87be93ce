"""What a base reports when it is asked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Any

from labmate.base.events import Bumper, Cause
from labmate.errors import StalePose
from labmate.odometry import Covariance, Pose

MAX_AGE = 0.2
"""A pose older than this (s) is not steered by."""

UNKNOWN: Covariance = ((nan, nan, nan), (nan, nan, nan), (nan, nan, nan))


@dataclass(frozen=True, slots=True)
class WheelCounts:
    """Encoder counts of both wheels at the machine's own time `stamp`, s."""

    left: int
    right: int
    stamp: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseReading:
    """One reading; m, rad, m/s, rad/s, V.

    `time` is the event loop's when it was asked: nothing in here was measured before. `stamp` is the machine's own
    time of the sample, for rates between two readings (s, from any origin, anew after a restart). `own_pose` is
    the base's own reckoning, in which GO and TURN are measured. `pose` is the best that is known and `covariance`
    belongs to it, NaN where unknown: the base's own, or the host's odometry where the base counts its wheels.
    `latched` bars motion until it is cleared. `battery` is NaN where unknown. `details` is what only this machine
    has, for status and JSON.
    """

    time: float
    stamp: float
    own_pose: Pose
    pose: Pose
    covariance: Covariance = UNKNOWN
    speed: float
    turn_rate: float
    at_rest: bool
    touching: Bumper
    latched: frozenset[Cause]
    battery: float = nan
    battery_low: bool = False
    counts: WheelCounts | None = None
    details: Mapping[str, Any] = field(default_factory=dict)

    def require_fresh(self, now: float, max_age: float = MAX_AGE) -> None:
        """Raise StalePose when the reading is too old to steer by."""
        age = now - self.time
        if not age <= max_age:
            raise StalePose(
                f"the pose is {1e3 * age:.0f} ms old, at most {1e3 * max_age:.0f} ms may be steered by"
            )
