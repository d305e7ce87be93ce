"""What a joint's traits allow: angles, speeds and accelerations, refused with the limit and the value."""

import math

from medusa.errors import CommandError
from medusa.head.drive import JointTraits

ROUNDING = 1 + 1e-9
"""A speed given in degrees comes back from radians with the last bit off."""


def check_angle(name: str, angle: float, traits: JointTraits) -> None:
    """Raise CommandError for an angle (rad) outside the soft limits."""
    if not traits.low <= angle <= traits.high:
        raise CommandError(
            f"{name}: {math.degrees(angle):.2f}° is outside the soft limits"
            f" {math.degrees(traits.low):.2f}..{math.degrees(traits.high):.2f}°"
        )


def check_speed(name: str, speed: float, traits: JointTraits) -> None:
    """Raise CommandError for a speed (rad/s) over the joint's."""
    if not abs(speed) <= traits.speed * ROUNDING:
        raise CommandError(
            f"{name}: a speed of {math.degrees(speed):.1f}°/s is over the limit of"
            f" {math.degrees(traits.speed):g}°/s"
        )


def check_acceleration(name: str, acceleration: float, traits: JointTraits) -> None:
    """Raise CommandError for an acceleration (rad/s²) that is not above zero or over the joint's."""
    if not 0 < acceleration <= traits.acceleration * ROUNDING:
        raise CommandError(
            f"{name}: an acceleration of {math.degrees(acceleration):.1f}°/s² is not in"
            f" (0, {math.degrees(traits.acceleration):g}]°/s²"
        )
