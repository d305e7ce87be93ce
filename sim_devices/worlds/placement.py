"""Where a body stands: a rotation and a position, and the ways it moves in time."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import asin, cos, pi, sin

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Motion = Callable[[float], "Placement"]
Signal = Callable[[float], float]


def _identity() -> Vector:
    return np.eye(3)


def _origin() -> Vector:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class Placement:
    """A body's frame in its parent's: p_parent = rotation @ p_body + position, metres."""

    rotation: Vector = field(default_factory=_identity)
    position: Vector = field(default_factory=_origin)

    def __matmul__(self, other: "Placement") -> "Placement":
        """The placement of ``other``, given in this body's frame, in this body's parent."""
        return Placement(self.rotation @ other.rotation, self.rotation @ other.position + self.position)

    def inverse(self) -> "Placement":
        """The parent's frame in the body's."""
        return Placement(self.rotation.T, -self.rotation.T @ self.position)


@dataclass(frozen=True, eq=False)
class Still:
    """The motion of a body that never moves."""

    placement: Placement

    def __call__(self, _t: float) -> Placement:
        return self.placement


def still(placement: Placement) -> Motion:
    """A body that never moves."""
    return Still(placement)


def mounted(carrier: Motion, seat: Placement) -> Motion:
    """The motion of what is fixed on a carrier; ``seat`` is its placement in the carrier's frame."""
    if isinstance(carrier, Still):
        return Still(carrier.placement @ seat)

    def at(t: float) -> Placement:
        return carrier(t) @ seat

    return at


def rotation_about(axis: int, angle: float) -> Vector:
    """Right-handed rotation by ``angle`` rad about coordinate axis 0, 1 or 2."""
    c, s = cos(angle), sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def facing(position: tuple[float, float, float], heading: float = 0.0, pitch: float = 0.0) -> Placement:
    """A picture at ``position`` seen upright by someone who looks along ``heading`` and ``pitch``.

    The picture's own frame is x right, y down, z away from the viewer. Heading is positive left and pitch
    positive down, rad; both zero is a picture seen by a viewer who looks along the world's x.
    """
    viewer = rotation_about(2, heading) @ rotation_about(1, pitch)
    axes = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    return Placement(viewer @ axes, np.array(position, dtype=float))


def constant(value: float) -> Signal:
    """A signal that keeps its value."""
    return lambda _t: value


def ramp(start: float, rate: float, stop: float | None = None) -> Signal:
    """From ``start`` at ``rate`` per second, standing at ``stop`` once it is reached."""

    def at(t: float) -> float:
        value = start + rate * t
        if stop is None:
            return value
        return min(value, stop) if rate >= 0.0 else max(value, stop)

    return at


def sine(amplitude: float, frequency: float, mean: float = 0.0, phase: float = 0.0) -> Signal:
    """mean + amplitude sin(2 pi f t + phase)."""
    return lambda t: mean + amplitude * sin(2.0 * pi * frequency * t + phase)


def triangle(amplitude: float, speed: float, mean: float = 0.0) -> Signal:
    """A triangle wave through ``mean`` at t = 0, rising at ``speed`` between the two turning points."""
    return lambda t: mean + 2.0 * amplitude / pi * asin(sin(0.5 * pi * speed * t / amplitude))


def on_bearing(azimuth: Signal, elevation: Signal, distance: Signal, turned: bool = True) -> Motion:
    """A picture carried round the world's origin: azimuth positive left, elevation positive up, rad.

    With ``turned`` it always faces the origin, otherwise it keeps facing along the world's -x.
    """

    def at(t: float) -> Placement:
        a, e, r = azimuth(t), elevation(t), distance(t)
        position = (r * cos(e) * cos(a), r * cos(e) * sin(a), r * sin(e))
        return facing(position, a, -e) if turned else facing(position)

    return at
