"""A joint of the head: shaft, hard stops, limit switches, home sensor, encoder and lost motion.

Positions are in encoder counts from the joint's zero, rising with a positive motor command: the shaft's m, and
the joint's j, which follows within the backlash. Motion is exact between changes of the motor command.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from math import exp, floor, inf

from sim_devices.motor import Bridge, Motor
from sim_devices.step_table import StepTable
from sim_devices.stretch import time_to_travel

INDEX_COUNTS = 2000
_SPEED_AT_REST = 1e-2
_ROUNDING_ROOM = 2.0
# Places between the hard stops: below the negative switch, …, above the positive one.
_NEGATIVE_SWITCH, _POSITIVE_SWITCH = 1, 4


@dataclass(frozen=True)
class JointGeometry:
    """Hard stop and switch at ± these counts, the sensor's edge, half the backlash.

    `sign`: +1 when the counts rise with the joint angle, −1 when it is mirrored. The sensor is on from its
    edge to the positive end of the joint.
    """

    stop: float
    switch: float
    edge: float
    sign: int = 1
    half_backlash: float = 0.0


class UnconnectedAxis:
    """What a spare axis of a board is wired to: no motor, no encoder pulses, switches open."""

    count = 0
    moving = ordinary = sensor = positive_closed = negative_closed = False
    angle = 0.0
    due = inf

    def __init__(self) -> None:
        self.index_armed = False
        self.on_home: Callable[[bool, int, float], None] = lambda level, count, t: None
        self.on_index: Callable[[int, float], None] = lambda count, t: None
        self.on_due: Callable[[], None] = lambda: None

    def drive(self, command: int) -> None:
        """Take a motor command that goes nowhere."""

    def settle(self) -> None:
        """Stand."""

    def advance_to(self, t: float) -> None:
        """Let time pass."""

    def step_to(self, t: float, period: float) -> None:
        """Let a sample pass."""

    def set_time(self, t: float) -> None:
        """Be at t."""


class Joint:
    """One motor with its joint; `on_home(level, count, t)` and `on_index(count, t)` report encoder edges."""

    def __init__(self, motor: Motor, geometry: JointGeometry, position: float, foldback_s: float) -> None:
        self.motor = motor
        self.geometry = geometry
        self.foldback_s = foldback_s
        self.t = 0.0
        self.w = 0.0
        self.index_armed = False
        self.forced_negative: bool | None = None
        self.forced_positive: bool | None = None
        self.forced_sensor: bool | None = None
        self.on_home: Callable[[bool, int, float], None] = lambda level, count, t: None
        self.on_index: Callable[[int, float], None] = lambda count, t: None
        self.due = inf
        self.on_due: Callable[[], None] = lambda: None
        """Called when `due` has come: something wired to the joint acts at that very time."""
        g = geometry
        self._marks = [-g.stop, -g.switch, g.edge, g.switch, g.stop]
        self._slack = g.half_backlash
        self.sensor = False
        self._step = (0.0, 0.0, 0.0)
        self.step_table: StepTable | None = None
        self.place(position)
        self.refresh()

    def place(self, position: float) -> None:
        """Put the joint somewhere by hand, at rest, in the middle of its backlash."""
        if not -self.geometry.stop < position < self.geometry.stop:
            raise ValueError(f"position {position:.1f} counts, the stops are at ±{self.geometry.stop:.1f}")
        self.m = self.j = position
        self.w = 0.0
        self._zone = bisect_right(self._marks, position)
        self._show_levels()

    @property
    def count(self) -> int:
        """Whole counts of the encoder, from the joint's zero."""
        return floor(self.m)

    @property
    def angle(self) -> float:
        """The true joint angle, rad."""
        return self.geometry.sign * self.j / self.motor.constants.counts_per_radian

    @property
    def moving(self) -> bool:
        """Whether it moves, or is driven."""
        return self.w != 0.0 or self.motor.target != 0.0

    def drive(self, command: int) -> None:
        """Take a motor command, −128..127."""
        self.motor.command = command
        self.motor.apply()

    def refresh(self) -> None:
        """Take over a changed bridge, switch, sensor or limit."""
        self.motor.apply()
        self._show_levels()
        self._plain = (
            self.motor.bridge is Bridge.ENABLED
            and not self.motor.held_at_zero
            and not self.motor.limit_can_act
            and self.forced_positive is None
            and self.forced_negative is None
        )
        """Nothing but the motor's own law and friction act, away from every mark."""
        self.ordinary = self._plain and self.motor.friction == 0.0 and self._slack == 0.0
        """And no friction, and no lost motion."""

    def free_range(self, rest: float) -> tuple[float, float]:
        """Return between what places the shaft may begin and end a step without reaching a mark in it.

        `rest` = h − T_M(1 − e^{−h/T_M}) for a step of h: a shaft that turns round within the step comes at most
        this time the highest speed beyond the place where it ends.
        """
        if not _NEGATIVE_SWITCH < self._zone < _POSITIVE_SWITCH:
            return inf, -inf
        speeds = self.motor.speeds
        room = max(speeds[127], -speeds[-128]) * rest + _ROUNDING_ROOM
        return self._marks[self._zone - 1] + room, self._marks[self._zone] - room

    def _show_levels(self) -> None:
        natural_sensor = (self._zone > 2) == (self.geometry.sign > 0)
        sensor = natural_sensor if self.forced_sensor is None else self.forced_sensor
        positive = self._zone >= _POSITIVE_SWITCH if self.forced_positive is None else self.forced_positive
        negative = self._zone <= _NEGATIVE_SWITCH if self.forced_negative is None else self.forced_negative
        self.positive_closed = self.motor.positive_blocked = positive
        self.negative_closed = self.motor.negative_blocked = negative
        if sensor != self.sensor:
            self.sensor = sensor
            self.on_home(sensor, self.count, self.t)

    def advance_to(self, t: float) -> None:
        """Run to t."""
        if t > self.t:
            self.advance(t - self.t)
            self.t = t

    def step_to(self, t: float, period: float) -> None:
        """Run one whole sample, which ends at t."""
        self.advance(period)
        self.t = t

    def set_time(self, t: float) -> None:
        """Be at t: somebody else has moved it there."""
        self.t = t

    def advance(self, h: float) -> None:
        """Run h seconds on, through whatever lies in them."""
        motor = self.motor
        if self.w == 0.0 and (motor.target == 0.0 or abs(motor.torque(0.0)) <= motor.friction):
            if motor.limit_can_act:
                motor.overload(0.0, h, self.foldback_s)
            self.t += h
            return
        if self._plain and not self.index_armed and self._advance_freely(h):
            self.t += h
            return
        while h > 0.0:
            dt = self._advance_stretch(h)
            self.t += dt
            h -= dt

    def _advance_freely(self, h: float) -> bool:
        """Take the whole step at once, unless a mark might be reached in it."""
        span, decay, reach = self._step
        if span != h:
            tau = self.motor.constants.time_constant
            decay = exp(-h / tau)
            reach = tau * (1.0 - decay)
            self._step = (h, decay, reach)
        if self.ordinary:
            low, high = self.free_range(h - reach)
            u = self.motor.target
            there = self.m + (self.w * reach + u * (h - reach))
            if not (low < self.m < high and low < there < high):
                return False
            self.m = self.j = there
            self.w = self.w * decay + u * (1.0 - decay)
            return True
        return self._advance_one_way(h, decay, reach)

    def _advance_one_way(self, h: float, decay: float, reach: float) -> bool:
        """Take the step with friction and lost motion, if the shaft neither turns nor reaches a mark in it."""
        if not _NEGATIVE_SWITCH < self._zone < _POSITIVE_SWITCH:
            return False
        way = 1 if (self.w or self.motor.target) > 0.0 else -1
        u = self.motor.target - way * self.motor.friction
        w = self.w * decay + u * (1.0 - decay)
        there = self.m + (self.w * reach + u * (h - reach))
        mark = self._marks[self._zone] + self._slack if way > 0 else self._marks[self._zone - 1] - self._slack
        if w * way <= 0.0 or (there - mark) * way >= 0.0:
            return False
        self._move(there, way)
        self.w = w
        return True

    def settle(self) -> None:
        """Let a shaft stand that nothing drives and that would not go a thousandth of a count any more."""
        if self.motor.target == 0.0 and abs(self.w) < _SPEED_AT_REST:
            self.w = 0.0

    def _advance_stretch(self, h: float) -> float:
        """Run to the next change of any kind, at most h; return the time that it took."""
        motor = self.motor
        pull = self.w if self.w != 0.0 else motor.torque(0.0)
        way = 1 if pull > 0.0 else -1
        if self.w == 0.0 and (abs(pull) <= motor.friction or self._presses(way)):
            if motor.limit_can_act:
                motor.overload(0.0, h, self.foldback_s)
            return h
        stretch, boundary = motor.stretch(self.w, way)
        dt, then = h, stretch.speed(h)
        for speed in (0.0, boundary):
            if speed is not None and (reached := stretch.when_speed(speed)) <= dt:
                dt, then = reached, speed
        mark, is_index = self._next_mark(way)
        travel = stretch.travel(dt)
        if travel * way >= (mark - self.m) * way:
            left = mark - self.m
            dt = min(time_to_travel(stretch, left, dt), dt) if left * way > 0.0 else 0.0
            then = stretch.speed(dt)
            self._move(mark, way)
            self.w = then if then * way > 0.0 else 0.0
            self._cross(mark, way, self.t + dt, is_index)
        else:
            self._move(self.m + travel, way)
            self.w = then
        if motor.limit_can_act:
            motor.overload(self.w, dt, self.foldback_s)
        return dt

    def _presses(self, way: int) -> bool:
        stop = self.geometry.stop + self._slack
        return self.m >= stop if way > 0 else self.m <= -stop

    def _next_mark(self, way: int) -> tuple[float, bool]:
        mark = self._marks[self._zone] + self._slack if way > 0 else self._marks[self._zone - 1] - self._slack
        if self.index_armed:
            # The pulse is one count wide: going down it begins where the count above it ends.
            period = self.m // INDEX_COUNTS if way > 0 else -((1.0 - self.m) // INDEX_COUNTS) - 1
            index = (period + 1) * INDEX_COUNTS if way > 0 else period * INDEX_COUNTS + 1.0
            if (mark - index) * way > 0.0:
                return index, True
        return mark, False

    def _move(self, m: float, way: int) -> None:
        self.m = m
        self.j = max(self.j, m - self._slack) if way > 0 else min(self.j, m + self._slack)

    def _cross(self, mark: float, way: int, t: float, is_index: bool) -> None:
        if is_index:
            self.on_index(INDEX_COUNTS * round(mark / INDEX_COUNTS), t)
            return
        if not 0 < self._zone + way < len(self._marks):
            self.w = 0.0
            return
        self._zone += way
        before = self.t
        self.t = t
        self._show_levels()
        self.t = before
