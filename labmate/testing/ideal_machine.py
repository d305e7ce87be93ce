"""The machine behind the ideal base: exact ramps, a watchdog, two bumpers, an emergency stop. No I/O, no clock."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, cos, inf, sin

from labmate.base.driver import Limits
from labmate.base.events import UNTOUCHED, Bumper, Cause, Stopped
from labmate.odometry import START, Pose

_STEP = 5e-3


class IdealMachine:
    """Where the base really is, and what it does; lazy: `advance` before looking. Disturb it by `happen`."""

    def __init__(self, limits: Limits) -> None:
        self.report: Callable[[Stopped], None] = lambda event: None
        self.now = 0.0
        self.pose = START
        self.forward, self.turning = _Ramp(limits.acceleration), _Ramp(limits.turn_acceleration)
        self.touching = UNTOUCHED
        self.button = False
        self.in_session = False
        self.watchdog_due = inf
        self._watchdog = inf
        self._expires = inf

    @property
    def at_rest(self) -> bool:
        """Whether it neither moves nor is going to."""
        return self.forward.at_rest and self.turning.at_rest

    def advance(self, to: float) -> None:
        """Run to a time, through its own deadlines."""
        while self.now < to:
            self._glide(min(to, self._expires, self.watchdog_due))
            if self.now >= self.watchdog_due:
                self.watchdog_due = inf
                self.ramp_down()
                self.report(Stopped(Cause.WATCHDOG, self.now))
            elif self.now >= self._expires:
                self.ramp_down()

    def happen(self, cause: Cause, touching: Bumper = UNTOUCHED) -> None:
        """Be touched, have its emergency stop pressed or its wheels held: it stops at once, and reports it."""
        self.touching |= touching
        self.halt()
        self.report(Stopped(cause, self.now, touching))

    def restart(self) -> None:
        """Lose everything but the place where it is."""
        self.halt()
        self.in_session = False
        self.set_watchdog(inf)

    def drive(self, speed: float, turn_rate: float, valid: float) -> None:
        """Ramp to a twist, and to a stop after `valid` s."""
        self.forward.target, self.turning.target, self._expires = speed, turn_rate, self.now + valid

    def ramp_down(self) -> None:
        """Ramp to a stop."""
        self.forward.target, self.turning.target, self._expires = 0.0, 0.0, inf

    def halt(self) -> None:
        """Stop at once."""
        self.ramp_down()
        self.forward.value = self.turning.value = 0.0

    def set_watchdog(self, seconds: float) -> None:
        """Ramp down when not fed for so long; infinity: never."""
        self._watchdog = seconds
        self.feed()

    def feed(self) -> None:
        """Count the watchdog's time anew."""
        self.watchdog_due = self.now + self._watchdog

    def _glide(self, to: float) -> None:
        while self.now < to:
            dt = min(_STEP, to - self.now)
            way, turn = self.forward.advance(dt), self.turning.advance(dt)
            middle = self.pose.heading + 0.5 * turn
            x, y = self.pose.x + way * cos(middle), self.pose.y + way * sin(middle)
            self.pose = Pose(x, y, self.pose.heading + turn)
            self.now = to if dt < _STEP else self.now + dt


class _Ramp:
    """A speed that follows its target at an acceleration."""

    def __init__(self, acceleration: float) -> None:
        self.value = self.target = 0.0
        self._acceleration = acceleration

    @property
    def at_rest(self) -> bool:
        return self.value == 0.0 and self.target == 0.0

    def advance(self, dt: float) -> float:
        """Go on for `dt` s; return the way."""
        before, ramp = self.value, min(dt, abs(self.target - self.value) / self._acceleration)
        change = copysign(ramp * self._acceleration, self.target - before)
        self.value = self.target if ramp < dt else before + change
        return 0.5 * (before + self.value) * ramp + self.target * (dt - ramp)
