"""What is asked of the base and what became of it: checks before a motion, the report after it. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, degrees, isfinite, sin
from typing import Literal

from labmate.driver.messages import Bumper, Ending, Flags, Limits, Mode
from labmate.errors import StalePose
from labmate.odometry import Covariance, Pose
from medusa.errors import CommandError

MAX_POSE_AGE = 0.2
"""A pose older than this (s) is not steered by."""
MAX_VALID = 0.3
"""Longest validity (s) of one DRIVE."""

Kind = Literal["GO", "TURN"]

# A speed given in degrees comes back from radians with the last bit off; a millionth of a limit is no excess.
_ROUNDING = 1.0 + 1e-6


@dataclass(frozen=True, slots=True)
class BaseSnapshot:
    """What the base said on one occasion.

    `time` is the event loop's when it was asked: nothing in here is older than the answer and nothing was
    measured before `time`. `pose` is the base's own reckoning, `odometry` the host's from the encoder counts
    (calibrated, if the base is), `covariance` belongs to the latter. m, rad, m/s, rad/s, V.
    """

    time: float
    device_time_us: int
    pose: Pose
    speed: float
    turn_rate: float
    left_counts: int
    right_counts: int
    mode: Mode
    flags: Flags
    battery: float
    odometry: Pose
    covariance: Covariance

    @property
    def at_rest(self) -> bool:
        """Idle, and both wheels at rest."""
        return self.mode is Mode.IDLE and not self.flags & Flags.MOVING

    def require_fresh(self, now: float, max_age: float = MAX_POSE_AGE) -> None:
        """Raise StalePose when the snapshot is too old to steer by."""
        age = now - self.time
        if not age <= max_age:
            raise StalePose(
                f"the pose is {1e3 * age:.0f} ms old, at most {1e3 * max_age:.0f} ms may be steered by"
            )


@dataclass(frozen=True, slots=True)
class MotionReport:
    """How a GO (m) or TURN (rad) ended; poses are the base's own, `travelled` is along them."""

    kind: Kind
    commanded: float
    travelled: float
    ending: Ending
    bumper: Bumper
    start: Pose
    end: Pose
    duration: float

    @property
    def reason(self) -> str:
        """What ended it, in words."""
        return ending_in_words(self.ending, self.bumper)

    def __str__(self) -> str:
        if self.kind == "GO":
            asked, done = f"{self.commanded:.3f} m", f"{self.travelled:.3f} m"
        else:
            asked, done = f"{degrees(self.commanded):.2f}°", f"{degrees(self.travelled):.2f}°"
        if self.ending is Ending.REACHED:
            return f"{self.kind} {asked}: reached {done}"
        return f"{self.kind} {asked} ended after {done}: {self.reason}"


def ending_in_words(ending: Ending, bumper: Bumper) -> str:
    """The reason that the base gave, with the bumpers that were named."""
    if ending is Ending.BUMPER:
        return f"{bumpers_in_words(bumper)} bumper" if bumper else "bumper"
    return ending.name.lower().replace("_", " ")


def bumpers_in_words(bumper: Bumper) -> str:
    """Names of the pressed sides."""
    return " and ".join(side.name.lower() for side in Bumper if side in bumper and side.name)


def pressed(flags: Flags) -> Bumper:
    """The bumpers of STATUS flags as event 51 numbers them."""
    return Bumper((flags >> 1) & 0xF)


def travelled(kind: Kind, start: Pose, end: Pose) -> float:
    """Way along the starting heading (m) or the turned angle (rad)."""
    if kind == "TURN":
        return end.heading - start.heading
    return (end.x - start.x) * cos(start.heading) + (end.y - start.y) * sin(start.heading)


def check_drive(limits: Limits, speed: float, turn_rate: float, valid: float) -> None:
    """Raise CommandError when a DRIVE exceeds the limits or lasts too long; nothing is clipped."""
    if not isfinite(speed) or not isfinite(turn_rate) or not isfinite(valid):
        raise CommandError(f"DRIVE needs finite numbers, not {speed} m/s, {turn_rate} rad/s, {valid} s")
    if abs(speed) > limits.speed * _ROUNDING:
        raise CommandError(f"speed {speed:.4g} m/s is over the limit of {limits.speed:.4g} m/s")
    if abs(turn_rate) > limits.turn_rate * _ROUNDING:
        raise CommandError(
            f"turn rate {degrees(turn_rate):.4g}°/s is over the limit of {degrees(limits.turn_rate):.4g}°/s"
        )
    if not 1e-3 <= valid <= MAX_VALID:
        raise CommandError(
            f"a DRIVE may be valid for 1 to {1e3 * MAX_VALID:.0f} ms, not {1e3 * valid:.4g} ms"
        )


def check_free_way(kind: Kind | Literal["DRIVE"], flags: Flags, forward: float, turning: float) -> None:
    """Raise CommandError, in words, for a motion that the base refuses by a latched stop or a pressed bumper.

    `forward` (m or m/s) and `turning` (rad or rad/s) count by their signs: away from a bumper is allowed.
    """
    if flags & Flags.EMERGENCY_STOP:
        raise CommandError(f"{kind}: the emergency stop is latched; clear it first", status=9)
    if flags & Flags.STALLED:
        raise CommandError(f"{kind}: the wheels stalled; clear it first", status=8)
    touching = pressed(flags)
    ahead = Bumper.FRONT if forward > 0.0 else Bumper.REAR if forward < 0.0 else Bumper(0)
    blocked = touching if turning != 0.0 else touching & ahead
    if blocked:
        raise CommandError(f"{kind}: the {bumpers_in_words(blocked)} bumper is pressed", status=8)


def stop_seconds(limits: Limits) -> float:
    """Longest ramp to a stop within the limits, s."""
    return max(limits.speed / limits.acceleration, limits.turn_rate / limits.turn_acceleration)
