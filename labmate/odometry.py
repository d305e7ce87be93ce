"""Dead reckoning of a differential-drive base from its encoder counts, with an honest covariance.

The encoders give the way of each wheel; between two readings both wheels are taken to have moved in a
constant proportion, for which the path is exactly an arc. Two things make the reckoned pose wrong, and both
are carried along:

- what differs from step to step (floor, slip): each wheel's way s has the variance k² |s|;
- what is the same in every step (wheel base and wheel ratio that are not quite known): the pose's
  sensitivities to the two are accumulated, so that their error grows coherently, as it does on the floor.

REP-103: x forward, y left, heading positive left and continuous. SI units and radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, pi, remainder, sin

_COUNTER_SPAN = 1 << 32


@dataclass(frozen=True, slots=True)
class Pose:
    """Position of the wheel axle's middle (m) and heading (rad, continuous, positive left)."""

    x: float
    y: float
    heading: float

    def seen_from(self, origin: Pose) -> Pose:
        """This pose in the frame of `origin` (both in one frame); the heading difference stays continuous."""
        c, s = cos(origin.heading), sin(origin.heading)
        dx, dy = self.x - origin.x, self.y - origin.y
        return Pose(c * dx + s * dy, c * dy - s * dx, self.heading - origin.heading)

    def distance_to(self, other: Pose) -> float:
        """Distance between the two positions, m."""
        return hypot(self.x - other.x, self.y - other.y)


START = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class WheelGeometry:
    """What the wheels do with a count: the two numbers that a bidirectional square can tell, and the scale.

    `wheel_base`: effective distance of the wheels' contact points, m. `wheel_ratio`: right over left diameter;
    the mean of the two diameters stays the nominal one, which `counts_per_metre` expresses.
    """

    wheel_base: float
    wheel_ratio: float
    counts_per_metre: float

    def __post_init__(self) -> None:
        for name in ("wheel_base", "wheel_ratio", "counts_per_metre"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(f"{name} must be positive and finite, it is {value}")

    @property
    def left_metres_per_count(self) -> float:
        """2 / (1 + E_d) of the nominal way of a count."""
        return 2.0 / (1.0 + self.wheel_ratio) / self.counts_per_metre

    @property
    def right_metres_per_count(self) -> float:
        """2 E_d / (1 + E_d) of the nominal way of a count."""
        return 2.0 * self.wheel_ratio / (1.0 + self.wheel_ratio) / self.counts_per_metre

    @property
    def drift(self) -> float:
        """Curvature κ (rad/m) of the path when both encoders count alike: 2 (E_d − 1) / ((E_d + 1) b)."""
        return 2.0 * (self.wheel_ratio - 1.0) / ((self.wheel_ratio + 1.0) * self.wheel_base)


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Uncertainty of the reckoning.

    `wheel`: k in m^½, the standard deviation of a wheel's way after one metre. `wheel_base` (m) and
    `wheel_ratio`: standard deviations of the two constants.
    """

    wheel: float
    wheel_base: float
    wheel_ratio: float

    def __post_init__(self) -> None:
        for name in ("wheel", "wheel_base", "wheel_ratio"):
            value = getattr(self, name)
            if not 0.0 <= value < float("inf"):
                raise ValueError(f"the deviation {name} must be finite and not negative, it is {value}")


UNCALIBRATED = OdometryNoise(1e-3, 3e-3, 2e-3)
"""A base known only by its data sheet."""

Row = tuple[float, float, float]
Covariance = tuple[Row, Row, Row]
"""3×3, symmetric, of (x, y, heading); m², m rad, rad²."""


class Odometry:
    """Reckons the pose from successive encoder readings.

    The first reading only sets the start; every later one moves the pose by an arc.
    """

    def __init__(self, geometry: WheelGeometry, noise: OdometryNoise, start: Pose = START) -> None:
        self.geometry = geometry
        self.noise = noise
        self.pose = start
        self.distance = 0.0
        """Way of the axle's middle so far, m, never falling."""
        self._counts: tuple[int, int] | None = None
        self._random = [0.0] * 6
        """Upper triangle of the covariance from the random part: xx, xy, xθ, yy, yθ, θθ."""
        self._by_base = [0.0] * 3
        self._by_ratio = [0.0] * 3

    def step(self, left_counts: int, right_counts: int) -> Pose:
        """Move the pose by the arc between the last reading and this one; counters may wrap at 32 bits.

        With the wheels' ways s_l, s_r: Δs = (s_l + s_r)/2, Δθ = (s_r − s_l)/b, chord c = Δs sin(Δθ/2)/(Δθ/2);
        x += c cos(θ + Δθ/2), y += c sin(θ + Δθ/2), θ += Δθ.
        """
        last, self._counts = self._counts, (left_counts, right_counts)
        if last is None:
            return self.pose
        left = int(remainder(left_counts - last[0], _COUNTER_SPAN))
        right = int(remainder(right_counts - last[1], _COUNTER_SPAN))
        if left or right:
            self._advance(left, right)
        return self.pose

    @property
    def covariance(self) -> Covariance:
        """Covariance of the pose: the random part, and that of the two constants through their sensitivities."""
        xx, xy, xh, yy, yh, hh = self._random
        b, r = self._by_base, self._by_ratio
        vb, vr = self.noise.wheel_base**2, self.noise.wheel_ratio**2

        def systematic(i: int, j: int) -> float:
            return vb * b[i] * b[j] + vr * r[i] * r[j]

        xx, xy, xh = xx + systematic(0, 0), xy + systematic(0, 1), xh + systematic(0, 2)
        yy, yh, hh = yy + systematic(1, 1), yh + systematic(1, 2), hh + systematic(2, 2)
        return ((xx, xy, xh), (xy, yy, yh), (xh, yh, hh))

    @property
    def sensitivity(self) -> tuple[Row, Row]:
        """∂(x, y, θ)/∂b and ∂(x, y, θ)/∂E_d of the present pose along the way that was driven."""
        b, r = self._by_base, self._by_ratio
        return (b[0], b[1], b[2]), (r[0], r[1], r[2])

    def _advance(self, left: int, right: int) -> None:
        g, theta = self.geometry, self.pose.heading
        s_l, s_r = left * g.left_metres_per_count, right * g.right_metres_per_count
        ds, turn = 0.5 * (s_l + s_r), (s_r - s_l) / g.wheel_base
        middle = theta + 0.5 * turn
        c, s = cos(middle), sin(middle)
        shape, slope = _chord(turn)
        dx, dy = ds * shape * c, ds * shape * s
        self.pose = Pose(self.pose.x + dx, self.pose.y + dy, theta + turn)
        self.distance += abs(ds)

        # ∂(Δx, Δy) by the way and by the turn of this arc; what the pose already had rotates it by (−Δy, Δx).
        x_ds, y_ds = shape * c, shape * s
        x_turn, y_turn = ds * (slope * c - 0.5 * shape * s), ds * (slope * s + 0.5 * shape * c)
        b = g.wheel_base
        self._grow_random(
            dx, dy, 0.5 * x_ds - x_turn / b, 0.5 * y_ds - y_turn / b, -1.0 / b, self.noise.wheel**2 * abs(s_l)
        )
        self._grow_random(
            0.0,
            0.0,
            0.5 * x_ds + x_turn / b,
            0.5 * y_ds + y_turn / b,
            1.0 / b,
            self.noise.wheel**2 * abs(s_r),
        )
        # By b: Δθ = (s_r − s_l)/b. By E_d: dE_d moves 2/(1+E_d)² of the nominal way from left to right.
        share = 2.0 / (1.0 + g.wheel_ratio) ** 2 / g.counts_per_metre
        way, swing = 0.5 * share * (right - left), share * (right + left) / b
        _carry(self._by_base, dx, dy, -turn / b * x_turn, -turn / b * y_turn, -turn / b)
        _carry(self._by_ratio, dx, dy, way * x_ds + swing * x_turn, way * y_ds + swing * y_turn, swing)

    def _grow_random(self, dx: float, dy: float, gx: float, gy: float, gh: float, variance: float) -> None:
        """P ← F P Fᵀ + g gᵀ variance, F = [[1, 0, −Δy], [0, 1, Δx], [0, 0, 1]]."""
        xx, xy, xh, yy, yh, hh = self._random
        self._random = [
            xx - 2.0 * dy * xh + dy * dy * hh + variance * gx * gx,
            xy + dx * xh - dy * yh - dx * dy * hh + variance * gx * gy,
            xh - dy * hh + variance * gx * gh,
            yy + 2.0 * dx * yh + dx * dx * hh + variance * gy * gy,
            yh + dx * hh + variance * gy * gh,
            hh + variance * gh * gh,
        ]


def _carry(sensitivity: list[float], dx: float, dy: float, x: float, y: float, heading: float) -> None:
    """Add this arc's own sensitivity to what the heading's earlier error does to it."""
    before = sensitivity[2]
    sensitivity[0] += x - dy * before
    sensitivity[1] += y + dx * before
    sensitivity[2] = before + heading


def _chord(turn: float) -> tuple[float, float]:
    """Chord over arc, sin(t/2)/(t/2), and its derivative by t; the series where the quotient would cancel."""
    half = 0.5 * turn
    if abs(half) < 1e-4:
        # Next terms: half⁴/120 and half³/60, below 1e-12 here.
        return 1.0 - half * half / 6.0, -half / 6.0
    shape = sin(half) / half
    return shape, 0.5 * (cos(half) - shape) / half


def wrapped(angle: float) -> float:
    """The angle in (−π, π]."""
    folded = remainder(angle, 2.0 * pi)
    return pi if folded == -pi else folded
