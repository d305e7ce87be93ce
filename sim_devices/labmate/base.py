"""The base's operations: what they take, when they are refused, what they answer (docs/protocols)."""

import struct
from collections.abc import Callable

from sim_devices.labmate.body import FRONT, NOMINAL_WHEEL_BASE, REAR, Pose
from sim_devices.labmate.config import BaseConfig
from sim_devices.labmate.motion import Motion
from sim_devices.labmate.operations import (
    ANGLE_UNIT,
    BAD_AXIS,
    BAD_LENGTH,
    BUSY,
    COUNTS_PER_METRE,
    DRIVE,
    EMERGENCY_LATCHED,
    ENCODERS,
    GO,
    LATCHED,
    LENGTH_UNIT,
    LIMITS,
    MAX_SPEED_UNITS,
    MAX_TURN_RATE_UNITS,
    OUT_OF_RANGE,
    PAYLOADS,
    POSE,
    SET_POSE,
    STATUS,
    STOP,
    TURN,
    UNKNOWN,
    VALID_MS,
    WRONG_MODE,
    Flag,
    Mode,
    clip_i16,
    wrap_i32,
)
from sim_devices.link.device import WHOLE_DEVICE, Refused


class Base:
    """The Labmate as the application of a link device."""

    device_type = 2
    firmware = 0x0200
    axes: frozenset[int] = frozenset()
    watchdog_actions = frozenset({0})
    emit: Callable[[int, int, bytes], None]

    def __init__(self, config: BaseConfig) -> None:
        self.emit = lambda operation, axis, payload: None
        self.motion = Motion(config, self._tell)
        self._body = self.motion.body
        self._power_up = 0.0
        self._zero_counts()

    def attach(self, power_up: float) -> None:
        """Count stamps from the time of power-up."""
        self._power_up = power_up
        self._body.now = max(self._body.now, power_up)

    def hello_part(self) -> bytes:
        """Return wheel base and counts per metre."""
        return struct.pack("<HI", round(NOMINAL_WHEEL_BASE / LENGTH_UNIT), COUNTS_PER_METRE)

    def advance_to(self, t: float) -> None:
        """Run up to t."""
        self.motion.advance_to(t)

    def next_due(self) -> float | None:
        """Return when to look at the base next."""
        return self.motion.next_due()

    def restart(self, t: float) -> None:
        """Lose pose, counts, limits, latches and what ran; the wheels run out."""
        self.motion.forget()
        self._zero_counts()

    def new_session(self) -> None:
        """Ramp to a stop; a GO or TURN that this ends gives no event."""
        self.motion.new_session()

    def watchdog_set(self, on: bool) -> None:
        """Nothing of the base depends on it."""

    def watchdog(self, action: int) -> None:
        """Ramp to a stop."""
        self.motion.watchdog(action)

    def emergency_stop(self) -> bool:
        """Stop at once, take the motors' power, latch."""
        return self.motion.emergency_stop()

    def clear(self, axis: int) -> None:
        """Release what is latched and whose cause is gone."""
        if axis != WHOLE_DEVICE:
            raise Refused(BAD_AXIS)
        self.motion.clear()

    def execute(self, operation: int, axis: int, payload: bytes) -> bytes:
        """Carry out an operation, or refuse it with the first status that applies."""
        form = PAYLOADS.get(operation)
        if form is None:
            raise Refused(UNKNOWN)
        if axis != WHOLE_DEVICE:
            raise Refused(BAD_AXIS)
        if len(payload) != struct.calcsize(form):
            raise Refused(BAD_LENGTH)
        fields = struct.unpack(form, payload)
        if operation == POSE:
            return self._time() + self._pose() + self._speeds()
        if operation == STATUS:
            millivolts = round(self.motion.battery.volts * 1000)
            return struct.pack("<BHH", self.motion.mode, self.flags(), millivolts)
        if operation == ENCODERS:
            return self._time() + struct.pack("<2i", *self.counts())
        if operation == STOP:
            self.motion.stop()
        elif operation == DRIVE:
            self._drive(*fields)
        elif operation == GO:
            self._go(*fields)
        elif operation == TURN:
            self._turn(*fields)
        elif operation == SET_POSE:
            self._set_pose(*fields)
        elif operation == LIMITS:
            self._set_limits(fields)
        return b""

    def flags(self) -> int:
        """Return the bits of STATUS."""
        flags = Flag(self._body.pressed << 1)
        if not self._body.at_rest:
            flags |= Flag.MOVING
        flags |= Flag.EMERGENCY_STOP if self.motion.emergency_latched else Flag.MOTOR_POWER
        if self.motion.battery.low:
            flags |= Flag.BATTERY_LOW
        if self.motion.stall_latched:
            flags |= Flag.STALLED
        return int(flags)

    def counts(self) -> tuple[int, int]:
        """Return the encoders' whole counts, left and right."""
        left, right = self._rolled()
        return (
            wrap_i32((left - self._zero[0]) * COUNTS_PER_METRE),
            wrap_i32((right - self._zero[1]) * COUNTS_PER_METRE),
        )

    def _drive(self, speed: int, turn_rate: int, valid_ms: int) -> None:
        self._refuse_latched(speed, turn_rate)
        if self.motion.mode in (Mode.GO, Mode.TURN):
            raise Refused(BUSY)
        top_speed, top_rate, _, _ = self.motion.limits
        if abs(speed) > top_speed or abs(turn_rate) > top_rate or valid_ms not in VALID_MS:
            raise Refused(OUT_OF_RANGE)
        self.motion.drive(speed * LENGTH_UNIT, turn_rate * ANGLE_UNIT, valid_ms / 1000)

    def _go(self, distance: int) -> None:
        self._refuse_latched(distance, 0)
        if self.motion.mode is Mode.IDLE and self.motion.battery.low:
            raise Refused(WRONG_MODE)
        if self.motion.mode is not Mode.IDLE:
            raise Refused(BUSY)
        self.motion.go(distance * LENGTH_UNIT)

    def _turn(self, angle: int) -> None:
        self._refuse_latched(0, angle)
        if self.motion.mode is not Mode.IDLE:
            raise Refused(BUSY)
        self.motion.turn(angle * ANGLE_UNIT)

    def _refuse_latched(self, forward: int, turning: int) -> None:
        """Refuse what a latched stop forbids, or a pressed bumper toward which the motion goes."""
        if self.motion.emergency_latched:
            raise Refused(EMERGENCY_LATCHED)
        pressed = self._body.pressed
        toward = (
            (turning != 0 and pressed != 0)
            or (forward > 0 and pressed & FRONT)
            or (forward < 0 and pressed & REAR)
        )
        if toward or self.motion.stall_latched:
            raise Refused(LATCHED)

    def _set_pose(self, x: int, y: int, heading: int) -> None:
        if self.motion.mode is not Mode.IDLE or not self._body.at_rest:
            raise Refused(WRONG_MODE)
        self._body.odometry = Pose(x * LENGTH_UNIT, y * LENGTH_UNIT, heading * ANGLE_UNIT)

    def _set_limits(self, limits: tuple[int, ...]) -> None:
        if self.motion.mode is not Mode.IDLE:
            raise Refused(WRONG_MODE)
        speed, turn_rate, acceleration, turn_acceleration = limits
        if 0 in limits or speed > MAX_SPEED_UNITS or turn_rate > MAX_TURN_RATE_UNITS:
            raise Refused(OUT_OF_RANGE)
        self.motion.limits = (speed, turn_rate, acceleration, turn_acceleration)

    def _tell(self, event: int, detail: int) -> None:
        self.emit(event, 0, self._time() + self._pose() + bytes((detail,)))

    def _time(self) -> bytes:
        return struct.pack("<I", round((self._body.now - self._power_up) * 1e6) & 0xFFFFFFFF)

    def _pose(self) -> bytes:
        x, y, heading = self._body.odometry
        return struct.pack(
            "<3i", wrap_i32(x / LENGTH_UNIT), wrap_i32(y / LENGTH_UNIT), wrap_i32(heading / ANGLE_UNIT)
        )

    def _speeds(self) -> bytes:
        return struct.pack(
            "<2h",
            clip_i16(self._body.forward.speed / LENGTH_UNIT),
            clip_i16(self._body.turning.speed / ANGLE_UNIT),
        )

    def _rolled(self) -> tuple[float, float]:
        return self._body.wheels["left"].rolled, self._body.wheels["right"].rolled

    def _zero_counts(self) -> None:
        self._zero = self._rolled()
