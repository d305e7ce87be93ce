"""Where a target will be: a constant-velocity Kalman filter of one coordinate, irregular samples and gaps included."""

import math
from dataclasses import dataclass

# How much one picture may change the multiple of q, in its logarithm, downward and upward.
_CALMING, _ROUSING = 0.15, 0.5


@dataclass(frozen=True)
class Prediction:
    """A coordinate at a moment: value, rate, and the variance of the value."""

    value: float
    rate: float
    variance: float


class ConstantVelocityFilter:
    """State (x, ẋ), white acceleration of density q: x⁺ = x + ẋ t, P⁺ = F P Fᵀ + q [[t³/3, t²/2], [t²/2, t]].

    acceleration: q [unit²/s³], how much the velocity may wander; about (typical acceleration)² × (how long it
    lasts). agility: least and greatest multiple of q. Innovations smaller than their expected deviation lower
    the multiple, larger ones raise it, faster: a target at rest is not chased through the noise, and one that
    turns is believed within a few pictures. gate: a measurement further than this many standard deviations off
    starts the filter anew: the target jumped, or is another one.
    """

    def __init__(
        self,
        acceleration: float,
        *,
        agility: tuple[float, float] = (1.0, 1.0),
        rate_sigma: float = 1.0,
        gate: float = 8.0,
    ) -> None:
        if acceleration <= 0:
            raise ValueError(f"acceleration density {acceleration} must be positive")
        if not 0 < agility[0] <= 1.0 <= agility[1]:
            raise ValueError(f"agility {agility} must run from above 0 up to 1, and from 1 on")
        self._q = acceleration
        self._agility = agility
        self._multiple = 1.0
        self._rate_variance = rate_sigma * rate_sigma
        self._gate = gate
        self._stamp: float | None = None
        self._x = self._v = 0.0
        self._xx = self._xv = self._vv = 0.0

    @property
    def stamp(self) -> float | None:
        """Moment of the last measurement, None before the first."""
        return self._stamp

    def update(self, stamp: float, value: float, sigma: float) -> None:
        """Take in a measurement of standard deviation sigma. Raises ValueError when it is older than the last one."""
        noise = sigma * sigma
        if self._stamp is None:
            self._start(stamp, value, noise)
            return
        if stamp < self._stamp:
            raise ValueError(f"measurement of {stamp:.6f} s after one of {self._stamp:.6f} s")
        x, xx, xv, vv = self._ahead(stamp - self._stamp)
        innovation, spread = value - x, xx + noise
        if innovation * innovation > self._gate * self._gate * spread:
            self._start(stamp, value, noise)
            return
        self._adapt(innovation * innovation / spread)
        gain_x, gain_v = xx / spread, xv / spread
        self._stamp, self._x, self._v = stamp, x + gain_x * innovation, self._v + gain_v * innovation
        self._xx, self._xv, self._vv = (1 - gain_x) * xx, (1 - gain_x) * xv, vv - gain_v * xv

    def predict(self, moment: float) -> Prediction:
        """The coordinate at a moment after the last measurement. Raises ValueError before the first one."""
        if self._stamp is None:
            raise ValueError("nothing has been measured yet")
        x, xx, _, _ = self._ahead(moment - self._stamp)
        return Prediction(x, self._v, xx)

    def halt(self) -> None:
        """Believe no longer in the velocity: the coordinate rests where it was last, until it is measured again."""
        self._v = 0.0
        self._xv, self._vv = 0.0, self._rate_variance

    def forget(self) -> None:
        """Start anew with the next measurement."""
        self._stamp = None

    def _adapt(self, surprise: float) -> None:
        """Move the multiple of q: `surprise` is the innovation squared over its expected variance, 1 on average."""
        step = _CALMING * (surprise - 1) if surprise < 1 else _ROUSING * (min(surprise, 9.0) - 1)
        self._multiple = min(max(self._multiple * math.exp(step), self._agility[0]), self._agility[1])

    def _start(self, stamp: float, value: float, noise: float) -> None:
        self._stamp, self._x, self._v = stamp, value, 0.0
        self._xx, self._xv, self._vv = noise, 0.0, self._rate_variance
        self._multiple = 1.0

    def _ahead(self, t: float) -> tuple[float, float, float, float]:
        q = self._q * self._multiple
        xx = self._xx + 2 * t * self._xv + t * t * self._vv + q * t**3 / 3
        xv = self._xv + t * self._vv + q * t * t / 2
        return self._x + self._v * t, xx, xv, self._vv + q * t


def steady_gains(acceleration: float, sigma: float, period: float) -> tuple[float, float]:
    """Gains (α, β/T) that the filter settles to with measurements every `period`: from the fixed point of its
    Riccati recursion.

    With λ = √q T^{3/2}/σ they depend on λ alone; found by iterating the recursion until it is stationary.
    """
    q, t, noise = acceleration, period, sigma * sigma
    xx, xv, vv = noise, 0.0, noise / (t * t)
    gain_x = gain_v = 0.0
    for _ in range(10_000):
        ahead_xx = xx + 2 * t * xv + t * t * vv + q * t**3 / 3
        ahead_xv = xv + t * vv + q * t * t / 2
        ahead_vv = vv + q * t
        spread = ahead_xx + noise
        last = gain_x
        gain_x, gain_v = ahead_xx / spread, ahead_xv / spread
        xx, xv, vv = (1 - gain_x) * ahead_xx, (1 - gain_x) * ahead_xv, ahead_vv - gain_v * ahead_xv
        if math.isclose(gain_x, last, rel_tol=1e-12):
            break
    return gain_x, gain_v
