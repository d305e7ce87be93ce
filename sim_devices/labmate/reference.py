"""References of the base: piecewise linear in time, and how a first-order drive follows them, in closed form."""

from collections.abc import Iterable
from math import exp, inf, pi, sqrt
from typing import NamedTuple

POLE_HZ = 5.0
TIME_CONSTANT = 1 / (2 * pi * POLE_HZ)
"""The drive's, 31.8 ms."""


class Piece(NamedTuple):
    """A straight piece of a reference: until a time, at a slope, up to a value."""

    end: float
    slope: float
    value: float


class Channel:
    """A speed reference, and the speed that follows it: τ ẏ + y = r, stepped exactly."""

    __slots__ = ("pieces", "reference", "speed")

    def __init__(self) -> None:
        self.reference = 0.0
        self.speed = 0.0
        self.pieces: list[Piece] = []

    @property
    def next_break(self) -> float:
        """When the present piece ends; infinity when the reference stays."""
        return self.pieces[0].end if self.pieces else inf

    @property
    def settled(self) -> bool:
        """Whether the speed stays as it is."""
        return not self.pieces and self.speed == self.reference

    @property
    def bound(self) -> float:
        """No speed above this, whichever way, with the reference as planned."""
        return max(abs(self.speed), abs(self.reference), *(abs(p.value) for p in self.pieces), 0.0)

    def zero(self) -> None:
        """Stop at once: the reference becomes zero without a ramp."""
        self.reference = 0.0
        self.pieces = []

    def ramp(self, target: float, rate: float, now: float) -> None:
        """Ramp to a target at a rate."""
        way = target - self.reference
        self.pieces = []
        if way != 0:
            self.pieces = [Piece(now + abs(way) / rate, rate if way > 0 else -rate, target)]

    def travel(self, distance: float, limit: float, rate: float, now: float) -> None:
        """Cover a distance from rest with a trapezoid (a triangle when it is short)."""
        sign = 1 if distance >= 0 else -1
        top = min(limit, sqrt(abs(distance) * rate))
        if top == 0:
            return
        up = top / rate
        cruise = abs(distance) / top - up
        self.pieces = [
            Piece(now + up, sign * rate, sign * top),
            Piece(now + up + cruise, 0.0, sign * top),
            Piece(now + 2 * up + cruise, -sign * rate, 0.0),
        ]

    def step(self, now: float, duration: float) -> float:
        """Advance within the present piece; return ∫ y dt."""
        slope = self.pieces[0].slope if self.pieces else 0.0
        start, speed = self.reference, self.speed
        if slope == 0 and start == speed:
            travelled = speed * duration
        else:
            lag = slope * TIME_CONSTANT
            off = speed - start + lag
            decay = exp(-duration / TIME_CONSTANT)
            self.reference = start + slope * duration
            self.speed = self.reference - lag + off * decay
            travelled = (start - lag + slope * duration / 2) * duration + off * TIME_CONSTANT * (1 - decay)
        while self.pieces and self.pieces[0].end <= now + duration:
            self.reference = self.pieces.pop(0).value
        return travelled


def still(channels: Iterable[Channel]) -> bool:
    """Whether every reference is zero and stays so."""
    return all(channel.reference == 0 and not channel.pieces for channel in channels)
