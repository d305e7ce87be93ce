"""A base and a host's hand on it, without a wire: frames in, frames out, at chosen times."""

import struct

import pytest

from sim_devices.labmate import BaseConfig, BaseMachine
from sim_devices.link.frame import FrameReceiver, Kind, encode_frame

HELLO, PING, STATISTICS, WATCHDOG, EMERGENCY_STOP, CLEAR, EVENT_MASK = range(1, 8)
POSE, SET_POSE, DRIVE, GO, TURN, STOP, LIMITS, STATUS, ENCODERS = range(0x30, 0x39)


class Station:
    """Asks the base, keeps its events (time sent, operation, fields), and lets time pass as a line would."""

    def __init__(self, config=None, seed=1):
        self.machine = BaseMachine(config or BaseConfig(), seed)
        self.device = self.machine.device
        self.device.send = self._hear
        self.body = self.machine.base.motion.body
        self.now = 0.0
        self.sequence = 0
        self.replies = []
        self.events = []
        self.acknowledgements = []
        self.frames = []
        self.wakes = []
        self.request(HELLO, b"ab")
        self.request(EVENT_MASK, b"\xff\xff\xff\xff")

    def _hear(self, data, t):
        self.frames.append((t, data))
        for message in FrameReceiver().feed(data):
            if message.kind == Kind.REPLY:
                self.replies.append(message)
            elif message.kind == Kind.EVENT:
                self.events.append((t, message.operation, struct.unpack("<I3iB", message.payload)))
                self.acknowledgements.append(
                    encode_frame(0x10, Kind.ACKNOWLEDGEMENT, message.sequence, message.operation, 0)
                )

    def _acknowledge(self):
        """Answer the events so far, as a host does: after the device is done."""
        while self.acknowledgements:
            self.device.receive(self.acknowledgements.pop(0), self.now)

    def request(self, operation, payload=b"", axis=0x0F):
        self.sequence = (self.sequence + 1) % 64
        self.replies.clear()
        self.device.receive(
            encode_frame(self.machine.config.address, 0, self.sequence, operation, axis, payload), self.now
        )
        (reply,) = self.replies
        self._acknowledge()
        return reply

    def status_of(self, operation, form="", *fields, axis=0x0F):
        return self.request(operation, struct.pack(form, *fields), axis).axis

    def drive(self, speed, turn_rate=0, valid_ms=2000):
        return self.status_of(DRIVE, "<hhH", speed, turn_rate, valid_ms)

    def go(self, distance):
        return self.status_of(GO, "<i", distance)

    def turn(self, angle):
        return self.status_of(TURN, "<i", angle)

    def stop(self):
        return self.status_of(STOP)

    def limits(self, *limits):
        return self.status_of(LIMITS, "<4H", *limits)

    def pose(self):
        """Return time_us, x, y, heading, speed, turn rate in the wire's units."""
        return struct.unpack("<I3i2h", self.request(POSE).payload)

    def status(self):
        """Return mode, flags, millivolts."""
        return struct.unpack("<BHH", self.request(STATUS).payload)

    @property
    def mode(self):
        return self.status()[0]

    @property
    def flags(self):
        return self.status()[1]

    def encoders(self):
        return struct.unpack("<I2i", self.request(ENCODERS).payload)

    def advance(self, t):
        """Let time pass to t, waking the device whenever it asked to be woken."""
        while (due := self.device.next_due()) is not None and due <= t:
            self.wakes.append(due)
            self.now = max(due, self.now)
            self.device.advance_to(due)
            self._acknowledge()
        self.now = t
        self.device.advance_to(t)
        self._acknowledge()

    def run(self, seconds):
        self.advance(self.now + seconds)

    def finish(self, within=200.0):
        """Let time pass until the base is in mode 0 and stands."""
        ends = self.now + within
        while self.mode != 0 or self.flags & 1:
            due = self.device.next_due()
            assert due is not None, "the base asks for nothing but is not done"
            assert due <= ends, "the base does not come to an end"
            self.advance(max(due, self.now + 1e-6))

    def told(self):
        """Return and forget (operation, detail) of the events so far."""
        told = [(operation, fields[-1]) for _, operation, fields in self.events]
        self.events.clear()
        return told


@pytest.fixture
def station():
    return Station()


@pytest.fixture
def make_station():
    return Station
