"""What the base is doing: its modes, how each motion begins and ends, and what is told of it."""

from collections.abc import Callable
from math import inf

from sim_devices.labmate.battery import HELD_AMPERES, IDLE_AMPERES, MOVING_AMPERES, Battery
from sim_devices.labmate.body import Body, Happening, Pose
from sim_devices.labmate.config import BaseConfig
from sim_devices.labmate.operations import (
    ACCELERATION_UNIT,
    ANGLE_UNIT,
    EVENT_BATTERY_LOW,
    EVENT_BUMPER,
    EVENT_DONE,
    EVENT_EMERGENCY_STOP,
    EVENT_STALLED,
    EVENT_WATCHDOG,
    LENGTH_UNIT,
    TURN_ACCELERATION_UNIT,
    Mode,
    Outcome,
)

LIMITS_AT_POWER_UP = (3000, 1500, 250, 300)
"""Speed, turn rate, acceleration, turn acceleration in the wire's units."""

# A motion of no length ends a moment after it began: its answer goes before its event.
_NO_LENGTH_S = 1e-3


class Motion:
    """Modes and motions over a body; `tell(event, detail)` is called at the instant of each event."""

    def __init__(self, config: BaseConfig, tell: Callable[[int, int], None]) -> None:
        self.body = Body(config)
        self.battery = Battery(config.battery, config.battery_volts_per_ampere_hour)
        self.button_held = False
        self._tell = tell
        self.forget()

    def forget(self) -> None:
        """Power up: everything is as at the start but the body, which runs out as it was."""
        self.body.stop_at_once()
        self.body.odometry = Pose(0.0, 0.0, 0.0)
        self.mode = Mode.IDLE
        self.limits = LIMITS_AT_POWER_UP
        self.emergency_latched = self.button_held
        self.stall_latched = False
        self._valid_until = inf
        self._ends_from = 0.0
        self._ended_by: Outcome | None = None
        self._low_told = self.battery.low

    @property
    def now(self) -> float:
        """The time that the base has reached."""
        return self.body.now

    def advance_to(self, t: float) -> None:
        """Run to t through everything that happens before, each thing at its own time."""
        body = self.body
        while body.now < t:
            before = body.now
            amperes = self.amperes()
            happening = body.advance_to(min(t, self._deadline()))
            self.battery.drain(amperes, body.now - before)
            self.settle(happening or Happening())

    def next_due(self) -> float | None:
        """When to look again."""
        due = min(self._deadline(), self.body.next_time())
        return None if due == inf else due

    def amperes(self) -> float:
        """Return the current drawn now."""
        if self.body.held:
            return HELD_AMPERES
        return IDLE_AMPERES if self.body.unmoved else MOVING_AMPERES

    def drive(self, speed: float, turn_rate: float, valid_s: float) -> None:
        """Ramp to a speed and a turn rate, valid for a time; m/s, rad/s."""
        self._report()
        self.mode = Mode.DRIVE
        self._valid_until = self.now + valid_s
        self._ramp(speed, turn_rate)

    def go(self, distance: float) -> None:
        """Cover a distance, m."""
        _, _, acceleration, _ = self.limits
        self._begin(Mode.GO)
        self.body.forward.travel(
            distance, self.limits[0] * LENGTH_UNIT, acceleration * ACCELERATION_UNIT, self.now
        )
        self.body.replanned()

    def turn(self, angle: float) -> None:
        """Turn by an angle, rad."""
        _, turn_rate, _, acceleration = self.limits
        self._begin(Mode.TURN)
        self.body.turning.travel(
            angle, turn_rate * ANGLE_UNIT, acceleration * TURN_ACCELERATION_UNIT, self.now
        )
        self.body.replanned()

    def stop(self) -> None:
        """Ramp to a stop."""
        self._end(Outcome.STOP)

    def watchdog(self, action: int) -> None:
        """Tell, and ramp to a stop."""
        self._tell(EVENT_WATCHDOG, action)
        self._end(Outcome.WATCHDOG)

    def new_session(self) -> None:
        """Ramp to a stop; a GO or TURN that this ends is not told of."""
        self._ended_by = None
        self._end(None)

    def emergency_stop(self) -> bool:
        """Stop at once and latch; True when it was not latched yet."""
        new = not self.emergency_latched
        self.emergency_latched = True
        if new:
            self._tell(EVENT_EMERGENCY_STOP, 0)
        self._end(Outcome.EMERGENCY_STOP, at_once=True)
        return new

    def clear(self) -> None:
        """Release what is latched and whose cause is gone."""
        self.emergency_latched = self.button_held
        self.stall_latched = False

    def set_battery(self, volts: float) -> None:
        """Change the battery for another one, or age it."""
        self.battery.volts = volts
        self._low_told = self._low_told and self.battery.low
        self.settle(Happening())

    def look(self) -> None:
        """Notice what was done to the body from outside."""
        self.settle(self.body.look())

    def settle(self, happening: Happening) -> None:
        """Draw the consequences of what happened, and of the present time."""
        if happening.pressed:
            self._tell(EVENT_BUMPER, happening.pressed)
            self._end(Outcome.BUMPER, at_once=True)
        if happening.stalled:
            self.stall_latched = True
            self._tell(EVENT_STALLED, 0)
            self._end(Outcome.STALLED, at_once=True)
        if self._valid_until <= self.now:
            self._end(None)
        if self.battery.low and not self._low_told:
            self._low_told = True
            self._tell(EVENT_BATTERY_LOW, 0)
        if self.mode in (Mode.GO, Mode.TURN) and self.now >= self._ends_from and self.body.unmoved:
            self._ended_by = Outcome.REACHED
            self._finish()
        elif self.mode is Mode.STOPPING and self.body.unmoved:
            self._finish()

    def _begin(self, mode: Mode) -> None:
        self.mode = mode
        self._ends_from = self.now + _NO_LENGTH_S

    def _end(self, outcome: Outcome | None, at_once: bool = False) -> None:
        """End what runs, by a ramp or at once; the first cause is the one that is told."""
        if at_once:
            self.body.stop_at_once()
        if self.mode in (Mode.GO, Mode.TURN):
            self._ended_by = outcome
        if self.mode is not Mode.IDLE:
            if not at_once and self.mode is not Mode.STOPPING:
                self._ramp(0.0, 0.0)
            self.mode = Mode.STOPPING
        self._valid_until = inf
        self.body.replanned()
        if self.mode is Mode.STOPPING and self.body.unmoved:
            self._finish()

    def _finish(self) -> None:
        self.mode = Mode.IDLE
        self._report()

    def _report(self) -> None:
        """Tell how the GO or TURN ended that has not been told of yet."""
        outcome, self._ended_by = self._ended_by, None
        if outcome is not None:
            self._tell(EVENT_DONE, outcome)

    def _ramp(self, speed: float, turn_rate: float) -> None:
        _, _, acceleration, turn_acceleration = self.limits
        self.body.forward.ramp(speed, acceleration * ACCELERATION_UNIT, self.now)
        self.body.turning.ramp(turn_rate, turn_acceleration * TURN_ACCELERATION_UNIT, self.now)
        self.body.replanned()

    def _deadline(self) -> float:
        """When the firmware itself acts next, apart from what the body meets."""
        due = self._valid_until
        if not self._low_told:
            due = min(due, self.now + self.battery.low_after(self.amperes()))
        if self.mode in (Mode.GO, Mode.TURN) and self.now < self._ends_from:
            due = min(due, self._ends_from)
        return due
