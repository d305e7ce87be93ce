"""A framed device from the device's side: session, kept replies, events, watchdog."""

import logging
import random
import struct
from collections.abc import Callable
from math import inf

from sim_devices.link.application import Application, Executed, Refused
from sim_devices.link.events import EventQueue
from sim_devices.link.frame import FrameFault, FrameReceiver, Kind, Message, encode_frame

__all__ = ["Application", "Executed", "LinkDevice", "Refused", "first_boot_count"]

log = logging.getLogger(__name__)

PROTOCOL = 1
WHOLE_DEVICE = 0x0F
BROADCAST = 0
KEPT_REPLIES = 8

HELLO, PING, STATISTICS, WATCHDOG, EMERGENCY_STOP, CLEAR, EVENT_MASK = range(1, 8)
_BEFORE_HELLO = frozenset({HELLO, PING, STATISTICS, EMERGENCY_STOP})
_LENGTHS = {HELLO: 2, PING: 0, STATISTICS: 0, WATCHDOG: 3, EMERGENCY_STOP: 0, CLEAR: 0, EVENT_MASK: 4}
_FIRST_OF_APPLICATION = 0x10

OK, UNKNOWN_OPERATION, BAD_AXIS, BAD_LENGTH, OUT_OF_RANGE = range(5)
NO_HELLO = 10


class LinkDevice:
    """A device of the link's page on a line, with its application behind it.

    Set `journal = []` to have every command recorded that acted or was refused.
    """

    send: Callable[[bytes, float], None]

    def __init__(
        self, address: int, application: Application, *, boot_count: int, power_up: float = 0.0
    ) -> None:
        self.address = address
        self.application = application
        self.boot_count = boot_count
        self.journal: list[Executed] | None = None
        self.send = lambda data, t: None
        application.emit = self._emit
        self.power_up(power_up)

    def power_up(self, t: float) -> None:
        """Switch the device on for the first time, at t; the boot count stays."""
        self._power_up = self._now = t
        self._receiver = FrameReceiver()
        self._kept: dict[bytes, bytes] = {}
        self._events = EventQueue(self._send_event)
        self._said_hello = False
        self._mask = 0
        self._watchdog_s = inf
        self._watchdog_action = 0
        self._watchdog_due = inf
        self._frames = self._crc_errors = self._framing_errors = self._repeats = self._trips = 0
        self.application.attach(t)

    def restart(self, t: float) -> None:
        """Cycle the power: session, statistics and the application's state are lost, the boot count rises."""
        self.advance_to(t)
        self.boot_count = self.boot_count + 1 & 0xFFFF
        self.application.restart(t)
        self.power_up(t)

    def advance_to(self, t: float) -> None:
        """Run the application, the watchdog and the events' repeats up to t, in order of time."""
        if t < self._now:
            return
        while (due := min(self._watchdog_due, self._events.due)) <= t:
            self._run(max(due, self._now))
            if self._watchdog_due <= self._now:
                self._watchdog_due = inf
                self._trips += 1
                self.application.watchdog(self._watchdog_action)
            self._events.advance_to(self._now)
        self._run(t)

    def next_due(self) -> float | None:
        """Return when `advance_to` is wanted next, or None."""
        own = min(self._watchdog_due, self._events.due)
        due = self.application.next_due()
        if due is not None and due < own:
            return due
        return None if own == inf else own

    def receive(self, data: bytes, t: float) -> None:
        """Take bytes of which the last has arrived at t."""
        for message in self._receiver.feed(data):
            if not isinstance(message, tuple):
                if message is FrameFault.CRC:
                    self._crc_errors += 1
                else:
                    self._framing_errors += 1
            elif message.address == self.address:
                self.advance_to(t)
                self._take(message)
            elif message.address == BROADCAST:
                self.advance_to(t)
                self._take_broadcast(message)

    def _run(self, t: float) -> None:
        # The application's events of this stretch are sent at its end, when they are noticed.
        self._now = t
        self.application.advance_to(t)

    def _take(self, message: Message) -> None:
        if message.kind in (Kind.REPLY, Kind.EVENT):
            self._framing_errors += 1
            return
        self._frames += 1
        self._feed()
        if message.kind == Kind.ACKNOWLEDGEMENT:
            self._events.acknowledge(message.operation, message.sequence, self._now)
            return
        reply = self._kept.get(message.raw)
        if reply is not None:
            self._repeats += 1
        else:
            reply = self._answer(message)
            if self._said_hello and message.operation != HELLO:
                if len(self._kept) == KEPT_REPLIES:
                    del self._kept[next(iter(self._kept))]
                self._kept[message.raw] = reply
        if reply:
            self.send(reply, self._now)

    def _take_broadcast(self, message: Message) -> None:
        if message.kind == Kind.REQUEST and message.operation == EMERGENCY_STOP:
            self._frames += 1
            self._record(message, OK)
            self.application.emergency_stop()
        elif (
            message.kind == Kind.REQUEST
            and message.operation == PING
            and message.axis == WHOLE_DEVICE
            and not message.payload
        ):
            self._frames += 1
            self._feed()
        else:
            self._framing_errors += 1

    def _answer(self, message: Message) -> bytes:
        """Carry the request out; b"" when the device failed in it: whether it acted is then unknown."""
        status, payload = OK, b""
        try:
            payload = self._execute(message.operation, message.axis, message.payload)
        except Refused as refusal:
            status = refusal.status
        except Exception:
            log.exception(
                "device %02XH failed in operation %02XH, no answer", self.address, message.operation
            )
            return b""
        self._record(message, status)
        return encode_frame(self.address, Kind.REPLY, message.sequence, message.operation, status, payload)

    def _execute(self, operation: int, axis: int, payload: bytes) -> bytes:
        if not self._said_hello and operation not in _BEFORE_HELLO:
            raise Refused(NO_HELLO)
        if operation >= _FIRST_OF_APPLICATION:
            return self.application.execute(operation, axis, payload)
        length = _LENGTHS.get(operation)
        if length is None:
            raise Refused(UNKNOWN_OPERATION)
        if axis != WHOLE_DEVICE and operation != CLEAR:
            raise Refused(BAD_AXIS)
        if operation == CLEAR:
            return self._clear(axis, payload)
        if len(payload) != length:
            raise Refused(BAD_LENGTH)
        if operation == HELLO:
            return self._hello(payload)
        if operation == PING:
            return struct.pack("<I", round((self._now - self._power_up) * 1e6) & 0xFFFFFFFF)
        if operation == STATISTICS:
            return self._statistics()
        if operation == WATCHDOG:
            self._set_watchdog(*struct.unpack("<HB", payload))
        elif operation == EMERGENCY_STOP:
            self.application.emergency_stop()
        else:
            (self._mask,) = struct.unpack("<I", payload)
        return b""

    def _clear(self, axis: int, payload: bytes) -> bytes:
        if payload:
            # Only the application knows its axes, and a bad one (2) goes before a bad length (3).
            if axis != WHOLE_DEVICE and axis not in self.application.axes:
                raise Refused(BAD_AXIS)
            raise Refused(BAD_LENGTH)
        self.application.clear(axis)
        return b""

    def _hello(self, payload: bytes) -> bytes:
        self._said_hello = True
        self._kept.clear()
        self._events.reset()
        self._mask = 0
        self._watchdog_s = self._watchdog_due = inf
        self.application.new_session()
        self.application.watchdog_set(False)
        return (
            payload
            + struct.pack(
                "<BBHH",
                PROTOCOL,
                self.application.device_type,
                self.application.firmware,
                self.boot_count,
            )
            + self.application.hello_part()
        )

    def _statistics(self) -> bytes:
        counts = (
            self._crc_errors,
            self._framing_errors,
            self._repeats,
            self._events.given_up,
            self._trips,
        )
        return struct.pack("<I5H", self._frames & 0xFFFFFFFF, *(count & 0xFFFF for count in counts))

    def _set_watchdog(self, timeout_ms: int, action: int) -> None:
        if action not in self.application.watchdog_actions:
            raise Refused(OUT_OF_RANGE)
        self._watchdog_s = timeout_ms / 1000 if timeout_ms else inf
        self._watchdog_action = action
        self._feed()
        self.application.watchdog_set(timeout_ms > 0)

    def _feed(self) -> None:
        self._watchdog_due = self._now + self._watchdog_s

    def _emit(self, operation: int, axis: int, payload: bytes) -> None:
        if self._mask >> operation - 0x40 & 1:
            self._events.add(operation, axis, payload, self._now)

    def _send_event(self, operation: int, axis: int, payload: bytes, sequence: int, t: float) -> None:
        self.send(encode_frame(self.address, Kind.EVENT, sequence, operation, axis, payload), t)

    def _record(self, message: Message, status: int) -> None:
        if self.journal is not None:
            self.journal.append(
                Executed(
                    self._now, message.sequence, message.operation, message.axis, message.payload, status
                )
            )


def first_boot_count(seed: int | None, address: int) -> int:
    """Draw a boot count: from the seed, or from the operating system's random source."""
    source = random.SystemRandom() if seed is None else random.Random(f"boot count {seed} {address}")
    return source.randrange(0x10000)
