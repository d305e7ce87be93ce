"""The board behind its link: which operation has which payload, and what happens to all three axes at once."""

import struct
from collections.abc import Callable, Sequence
from operator import attrgetter

from sim_devices.hctl1100 import CLOCK_HZ
from sim_devices.joint import Joint, UnconnectedAxis
from sim_devices.link.device import Refused
from sim_devices.mc3000 import operations, raw_registers
from sim_devices.mc3000.channel import Channel
from sim_devices.mc3000.reports import EMERGENCY_STOP, NO_LATCH, WATCHDOG, Report

AXES = 3
WHOLE_DEVICE = 0x0F
WAKE_S = 0.005
DEVICE_TYPE = 1
FIRMWARE = 0x0102
IDLE_ACTION, STOP_ACTION = 0, 1
_LATCH_SOURCES = 4

Handler = Callable[["Mc3000", Channel, bytes], bytes]


class Mc3000:
    """Three channels as the application of a `LinkDevice`."""

    device_type = DEVICE_TYPE
    firmware = FIRMWARE
    axes = frozenset(range(AXES))
    watchdog_actions = frozenset({IDLE_ACTION, STOP_ACTION})

    def __init__(self, joints: Sequence[Joint | UnconnectedAxis]) -> None:
        if len(joints) != AXES:
            raise ValueError(f"{len(joints)} joints, the board has {AXES} axes")
        self.emit: Callable[[int, int, bytes], None] = lambda operation, axis, payload: None
        self._reports: list[Report] = []
        self.t = 0.0
        """The time that the board has come to."""
        self._watchdog_on = False
        self.channels = [Channel(n, joint, self._reports.append) for n, joint in enumerate(joints)]
        self._reports.clear()

    def attach(self, power_up: float) -> None:
        """Power up."""
        self.t = power_up
        self._watchdog_on = False
        self._reports.clear()
        for channel in self.channels:
            channel.power_up(power_up)

    def restart(self, t: float) -> None:
        """Lose every state at t; the joints keep their places."""
        self.settle(t)

    def hello_part(self) -> bytes:
        """Number of axes and the chips' clock."""
        return struct.pack("<BI", AXES, CLOCK_HZ)

    def advance_to(self, t: float) -> None:
        """Take every sample up to t and send the events of it, in order of time."""
        if t > self.t:
            self.t = t
            for channel in self.channels:
                # A channel at rest catches up when it is asked for.
                if channel.running or channel.active:
                    channel.advance_to(t)
        if self._reports:
            self._send_reports()

    def next_due(self) -> float | None:
        """Return now while an event waits, a wake later while anything moves or is in control, else None."""
        if self._reports:
            return self.t
        for channel in self.channels:
            if channel.running or channel.active:
                return self.t + WAKE_S
        return None

    def settle(self, t: float) -> None:
        """Bring every shaft and counter to t."""
        self.t = max(self.t, t)
        for channel in self.channels:
            channel.settle(self.t)

    def _send_reports(self) -> None:
        reports = sorted(self._reports, key=attrgetter("time_us"))
        self._reports.clear()
        for report in reports:
            payload = struct.pack("<IiB", report.time_us & 0xFFFFFFFF, report.position, report.detail)
            self.emit(report.operation, report.axis, payload)

    def _report_whole(self, operation: int, detail: int) -> None:
        time_us = self.channels[0].microseconds(self.t)
        self._reports.append(Report(time_us, operation, WHOLE_DEVICE, 0, detail))

    def execute(self, operation: int, axis: int, payload: bytes) -> bytes:
        """Carry out an operation; raises Refused with the status that goes first."""
        entry = _OPERATIONS.get(operation)
        if entry is None:
            raise Refused(1)
        of_axis, of_whole, lengths, handler = entry
        if not (of_axis and axis < AXES) and not (of_whole and axis == WHOLE_DEVICE):
            raise Refused(2)
        if len(payload) not in lengths:
            raise Refused(3)
        if axis == WHOLE_DEVICE:
            self.settle(self.t)
            channels = self.channels
        else:
            channels = self.channels[axis : axis + 1]
            channels[0].settle(self.t)
        reply = b""
        for channel in channels if operation == STOP else channels[:1]:
            reply = handler(self, channel, payload)
        if self._reports:
            self._send_reports()
        return reply

    def new_session(self) -> None:
        """HELLO: every axis idle; nothing armed is left."""
        self.settle(self.t)
        for channel in self.channels:
            channel.go_idle()
        self._reports.clear()

    def emergency_stop(self) -> bool:
        """Latch the emergency stop: every axis idle."""
        self.settle(self.t)
        fresh = not self.channels[0].emergency
        for channel in self.channels:
            channel.emergency = True
            channel.go_idle()
        if fresh:
            self._report_whole(EMERGENCY_STOP, 0)
        self._send_reports()
        return fresh

    def clear(self, axis: int) -> None:
        """CLEAR: the emergency stop on all axes, other latches on those named."""
        if axis != WHOLE_DEVICE and axis not in self.axes:
            raise Refused(2)
        self.settle(self.t)
        for channel in self.channels:
            channel.emergency = False
            if axis in (WHOLE_DEVICE, channel.number):
                operations.clear(channel)
        self._send_reports()

    def watchdog(self, action: int) -> None:
        """The host is silent: idle, or a ramp where a limit switch still guards it."""
        self.settle(self.t)
        for channel in self.channels:
            channel.watchdog_expired = True
            if action == IDLE_ACTION or not channel.limit_enable:
                channel.go_idle()
            else:
                operations.stop(channel)
        self._report_whole(WATCHDOG, action)
        self._send_reports()

    def watchdog_set(self, on: bool) -> None:
        """Without a watchdog nothing is driven open loop."""
        self._watchdog_on = on
        if not on:
            self.settle(self.t)
            for channel in self.channels:
                operations.zero_open_loop(channel)

    # One handler an operation

    def _read(self, axis: Channel, payload: bytes) -> bytes:
        return raw_registers.read(axis, *payload)

    def _write(self, axis: Channel, payload: bytes) -> bytes:
        raw_registers.write(axis, payload[0], payload[1:], watchdog_on=self._watchdog_on)
        return b""

    def _position(self, axis: Channel, payload: bytes) -> bytes:
        return struct.pack("<i", axis.chip.actual)

    def _command(self, axis: Channel, payload: bytes) -> bytes:
        operations.command(axis, *struct.unpack("<i", payload))
        return b""

    def _snapshot(self, axis: Channel, payload: bytes) -> bytes:
        parts = [struct.pack("<I", axis.microseconds(self.t) & 0xFFFFFFFF)]
        for channel in self.channels:
            chip = channel.chip
            parts.append(
                struct.pack(
                    "<iiBBBB",
                    chip.actual,
                    chip.command,
                    chip.status,
                    chip.flags,
                    chip.motor_command + 128,
                    channel.inputs,
                )
            )
        return b"".join(parts)

    def _filter(self, axis: Channel, payload: bytes) -> bytes:
        operations.set_filter(axis, *payload)
        return b""

    def _mode(self, axis: Channel, payload: bytes) -> bytes:
        operations.set_mode(axis, payload[0])
        return b""

    def _velocity(self, axis: Channel, payload: bytes) -> bytes:
        operations.velocity(axis, *struct.unpack("<h", payload))
        return b""

    def _profile(self, axis: Channel, payload: bytes) -> bytes:
        operations.profile(axis, *struct.unpack("<HB", payload))
        return b""

    def _move(self, axis: Channel, payload: bytes) -> bytes:
        operations.move(axis, *struct.unpack("<iB", payload))
        return b""

    def _start(self, axis: Channel, payload: bytes) -> bytes:
        mask = payload[0]
        named = [channel for channel in self.channels if mask >> channel.number & 1]
        operations.start_armed(named, valid=0 < mask < 1 << AXES)
        return b""

    def _preset(self, axis: Channel, payload: bytes) -> bytes:
        operations.preset(axis, *struct.unpack("<i", payload))
        return b""

    def _inputs(self, axis: Channel, payload: bytes) -> bytes:
        return bytes([axis.inputs])

    def _latch(self, axis: Channel, payload: bytes) -> bytes:
        if payload[0] >= _LATCH_SOURCES:
            raise Refused(operations.OUT_OF_RANGE)
        axis.arm_latch(payload[0])
        return b""

    def _limit_enable(self, axis: Channel, payload: bytes) -> bytes:
        operations.set_limit_enable(axis, payload[0])
        return b""

    def _following(self, axis: Channel, payload: bytes) -> bytes:
        (axis.following_limit,) = struct.unpack("<H", payload)
        return b""

    def _stop(self, axis: Channel, payload: bytes) -> bytes:
        operations.stop(axis)
        return b""

    def _latched(self, axis: Channel, payload: bytes) -> bytes:
        position, time_us = axis.caught or (0, 0)
        caught = axis.caught is not None
        source = axis.latch_source if axis.latch_source != NO_LATCH else 0
        return struct.pack("<BBiI", source, caught, position, time_us & 0xFFFFFFFF)

    def _settings(self, axis: Channel, payload: bytes) -> bytes:
        return struct.pack(
            "<BHBB", axis.mode, axis.following_limit, axis.limit_enable, axis.armed is not None
        )


STOP = 0x20
_OPERATIONS: dict[int, tuple[bool, bool, range, Handler]] = {
    0x10: (True, False, range(2, 3), Mc3000._read),
    0x11: (True, False, range(2, 2 + raw_registers.MOST_BYTES), Mc3000._write),
    0x12: (True, False, range(1), Mc3000._position),
    0x13: (True, False, range(4, 5), Mc3000._command),
    0x14: (False, True, range(1), Mc3000._snapshot),
    0x15: (True, False, range(4, 5), Mc3000._filter),
    0x16: (True, False, range(1, 2), Mc3000._mode),
    0x17: (True, False, range(2, 3), Mc3000._velocity),
    0x18: (True, False, range(3, 4), Mc3000._profile),
    0x19: (True, False, range(5, 6), Mc3000._move),
    0x1A: (False, True, range(1, 2), Mc3000._start),
    0x1B: (True, False, range(4, 5), Mc3000._preset),
    0x1C: (True, False, range(1), Mc3000._inputs),
    0x1D: (True, False, range(1, 2), Mc3000._latch),
    0x1E: (True, False, range(1, 2), Mc3000._limit_enable),
    0x1F: (True, False, range(2, 3), Mc3000._following),
    STOP: (True, True, range(1), Mc3000._stop),
    0x21: (True, False, range(1), Mc3000._latched),
    0x22: (True, False, range(1), Mc3000._settings),
}
"""Operation: on an axis, on the whole device, lengths of the payload, handler."""
