"""Motion with piecewise constant acceleration: ramps to a rate, trapezoids to an angle. Pure; SI units."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Motion:
    """From `time` (s) at `position` (rad) and `rate` (rad/s) on; pieces are (duration s, acceleration rad/s²).

    After the last piece the rate is `final`, to the last bit: a joint that came to rest does not creep.
    """

    time: float
    position: float
    rate: float = 0.0
    pieces: tuple[tuple[float, float], ...] = ()
    final: float = 0.0

    @property
    def end(self) -> float:
        """When the last piece ends, s."""
        return self.time + sum(duration for duration, _ in self.pieces)

    def at(self, now: float) -> tuple[float, float]:
        """(position, rate) at a moment, s; before the start those of the start."""
        left, position, rate = max(0.0, now - self.time), self.position, self.rate
        for duration, acceleration in self.pieces:
            step = min(left, duration)
            position += rate * step + acceleration * step**2 / 2
            rate += acceleration * step
            left -= step
        return (position + self.final * left, self.final) if now >= self.end else (position, rate)


def ramp(time: float, position: float, rate: float, to: float, acceleration: float) -> Motion:
    """From one rate to another at an acceleration: |to − rate|/a."""
    change = to - rate
    pieces = ((abs(change) / acceleration, math.copysign(acceleration, change)),)
    return Motion(time, position, rate, pieces, to)


def profile(
    time: float, position: float, rate: float, target: float, speed: float, acceleration: float
) -> Motion:
    """A trapezoid to `target`, or a triangle when half the distance comes first; a rate ends by its ramp before.

    v = min(speed, √(a d)), each ramp v/a, in between (d − v²/a)/v.
    """
    braking = ramp(time, position, rate, 0.0, acceleration) if rate else Motion(time, position)
    start = braking.at(braking.end)[0]
    distance = abs(target - start)
    way = math.copysign(1.0, target - start)
    peak = min(speed, math.sqrt(acceleration * distance))
    if peak == 0.0:
        return braking
    rising = peak / acceleration
    pieces = (
        (rising, way * acceleration),
        (max(0.0, (distance - peak * rising) / peak), 0.0),
        (rising, -way * acceleration),
    )
    return Motion(time, position, rate, braking.pieces + pieces)
