"""Closed forms of a shaft's motion while nothing about its drive changes."""

from dataclasses import dataclass
from math import exp, inf, log
from typing import Protocol


class Stretch(Protocol):
    """Motion from speed w, one way only: positions and speeds after a time, times of both."""

    def speed(self, dt: float) -> float:
        """Return the speed after dt."""

    def travel(self, dt: float) -> float:
        """Return how far the shaft has gone after dt."""

    def when_speed(self, speed: float) -> float:
        """Return after what time the speed is reached; infinity if never, or if it is so already."""


@dataclass(slots=True)
class Exponential:
    """ẇ = (u − w)/τ: w(t) = u + (w₀ − u)e^{−t/τ}."""

    start: float
    target: float
    time_constant: float

    def speed(self, dt: float) -> float:
        decay = exp(-dt / self.time_constant)
        return self.start * decay + self.target * (1.0 - decay)

    def travel(self, dt: float) -> float:
        reach = self.time_constant * (1.0 - exp(-dt / self.time_constant))
        return self.target * (dt - reach) + self.start * reach

    def when_speed(self, speed: float) -> float:
        left = speed - self.target
        if left == 0.0:
            return inf
        ratio = (self.start - self.target) / left
        return self.time_constant * log(ratio) if ratio > 1.0 else inf


@dataclass(slots=True)
class Uniform:
    """ẇ = a, a constant torque."""

    start: float
    acceleration: float

    def speed(self, dt: float) -> float:
        return self.start + self.acceleration * dt

    def travel(self, dt: float) -> float:
        return (self.start + 0.5 * self.acceleration * dt) * dt

    def when_speed(self, speed: float) -> float:
        if self.acceleration == 0.0:
            return inf
        dt = (speed - self.start) / self.acceleration
        return dt if dt > 0.0 else inf


def time_to_travel(stretch: Stretch, distance: float, longest: float) -> float:
    """Return when `distance` is gone, within 0..longest, by Newton's method inside a bracket."""
    low, high = 0.0, longest
    sign = 1.0 if distance >= 0.0 else -1.0
    dt = 0.5 * longest
    for _ in range(80):
        excess = stretch.travel(dt) - distance
        if excess == 0.0:
            return dt
        if excess * sign > 0.0:
            high = dt
        else:
            low = dt
        speed = stretch.speed(dt)
        following = dt - excess / speed if speed != 0.0 else -1.0
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - dt) <= 1e-12 * longest:
            return following
        dt = following
    return dt
