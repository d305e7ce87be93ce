"""What is refused before anything moves, in words. Pure."""

from __future__ import annotations

from math import degrees, isfinite
from typing import Literal

from labmate.base.driver import Kind, Limits
from labmate.base.events import UNTOUCHED, Bumper, Cause
from labmate.base.reading import BaseReading
from labmate.errors import BatteryLow
from medusa.errors import CommandError

SHORTEST_VALID = 1e-3

# A speed given in degrees comes back from radians with the last bit off; a millionth of a limit is no excess.
_ROUNDING = 1.0 + 1e-6


def check_twist(limits: Limits, expires: float, speed: float, turn_rate: float, valid: float) -> None:
    """Raise CommandError when a twist exceeds the limits or lasts longer than `expires` s; nothing is clipped."""
    if not isfinite(speed) or not isfinite(turn_rate) or not isfinite(valid):
        raise CommandError(f"DRIVE needs finite numbers, not {speed} m/s, {turn_rate} rad/s, {valid} s")
    if abs(speed) > limits.speed * _ROUNDING:
        raise CommandError(f"speed {speed:.4g} m/s is over the limit of {limits.speed:.4g} m/s")
    if abs(turn_rate) > limits.turn_rate * _ROUNDING:
        raise CommandError(
            f"turn rate {degrees(turn_rate):.4g}°/s is over the limit of {degrees(limits.turn_rate):.4g}°/s"
        )
    if not SHORTEST_VALID <= valid <= expires:
        raise CommandError(f"a DRIVE may be valid for 1 to {1e3 * expires:.0f} ms, not {1e3 * valid:.4g} ms")


def check_free_way(
    kind: Kind | Literal["DRIVE"], reading: BaseReading, forward: float, turning: float
) -> None:
    """Raise CommandError for a motion that a latched stop or a pressed bumper forbids.

    `forward` (m or m/s) and `turning` (rad or rad/s) count by their signs: away from a bumper is allowed.
    """
    if Cause.EMERGENCY_STOP in reading.latched:
        raise CommandError(f"{kind}: the emergency stop is latched; clear it first", status=9)
    if Cause.STALLED in reading.latched:
        raise CommandError(f"{kind}: the wheels stalled; clear it first", status=8)
    ahead = Bumper.FRONT if forward > 0.0 else Bumper.REAR if forward < 0.0 else UNTOUCHED
    blocked = reading.touching if turning != 0.0 else reading.touching & ahead
    if blocked:
        raise CommandError(f"{kind}: the {blocked.words} bumper is pressed", status=8)


def check_travel(kind: Kind, reading: BaseReading, forward: float, turning: float) -> None:
    """Raise CommandError for a GO or TURN that cannot begin: latched, touched, in motion, a low battery."""
    check_free_way(kind, reading, forward, turning)
    if not reading.at_rest:
        mode = reading.details.get("mode")
        now = "in motion" if mode is None else f"in mode {mode.upper()}"
        raise CommandError(f"{kind}: the base is {now}, it must be idle", status=11)
    if kind == "GO" and reading.battery_low:
        raise BatteryLow(
            f"GO: the battery is low ({reading.battery:.1f} V); turn, drive and stop still work", status=6
        )
