"""A host's hand on an emulated board: frames in, frames out, at chosen times, no wire between."""

import struct
from collections import namedtuple

import pytest

from sim_devices.head import HeadConfig, HeadMachine
from sim_devices.link.frame import FrameReceiver, Kind, encode_frame

WHOLE = 0x0F
FILTER, MODE, PROFILE = 0x15, 0x16, 0x18
# Nearest registers of equations §1.5 and the longest sample; axis 0 is the left eye.
EYE_FILTER = (225, 0, 5, 255)
SAMPLE = 2.048e-3
NAMES = {
    (1, 0): "left_vergence",
    (1, 1): "right_vergence",
    (1, 2): "tilt",
    (2, 0): "pan",
}

Event = namedtuple("Event", "operation axis time_us position detail")
Axis = namedtuple("Axis", "actual command status flags motor inputs")
Settings = namedtuple("Settings", "mode following limit_enable armed")


class Rig:
    """A head, one of its boards in hand, its amplifiers enabled."""

    def __init__(self, board=1, *, hello=True, enabled=True, **config):
        starts = dict.fromkeys(NAMES.values(), 0.0) | config.pop("start_deg", {})
        self.machine = HeadMachine(HeadConfig(start_deg=starts, **config), seed=0)
        self.machine.power_up(0.0)
        self.number = board
        self.device = self.machine.devices[board]
        self.board = self.machine.boards[board]
        self.sent = []
        self.times = []
        self.t = 0.0
        self.sequence = 0
        self._receiver = FrameReceiver()
        self._events = []
        self.device.send = self._take
        if enabled:
            for amplifier in self.machine.amplifiers.values():
                amplifier.write(7, 0, b"\x0f\0")
                amplifier.write(1, 0, b"\0\0")
        if hello:
            assert self.ask(0x01, b"\x12\x34")[0] == 0
            self.ok(0x07, struct.pack("<I", 0xFFFFFFFF))

    def _take(self, data, t):
        self.times.append(t)
        for message in self._receiver.feed(data):
            (self.sent if message.kind == Kind.REPLY else self._events).append(message)

    def ask(self, operation, payload=b"", axis=WHOLE):
        """Send one request; return status and payload of its reply."""
        self.sequence = (self.sequence + 1) % 64
        frame = encode_frame(self.number, Kind.REQUEST, self.sequence, operation, axis, bytes(payload))
        self.device.receive(frame, self.t)
        reply = self.sent.pop()
        assert (reply.sequence, reply.operation, self.sent) == (self.sequence, operation, [])
        return reply.axis, reply.payload

    def status(self, operation, payload=b"", axis=0):
        return self.ask(operation, payload, axis)[0]

    def ok(self, operation, payload=b"", axis=WHOLE):
        status, reply = self.ask(operation, payload, axis)
        assert status == 0, f"operation {operation:02X}H answered {status}"
        return reply

    def run(self, seconds):
        """Let time pass as a line does: by way of every time at which the device is due."""
        end = self.t + seconds
        while (due := self.device.next_due()) is not None and due <= end:
            # A device may be due at once, for an event that something out of band has caused.
            self.t = max(due, self.t)
            self.device.advance_to(self.t)
        self.t = end
        self.device.advance_to(end)

    def run_samples(self, count):
        """Let `count` samples of 2.048 ms pass, to the middle between two of them."""
        now = int(self.t / SAMPLE + 1e-9)
        self.run((now + count + 0.5) * SAMPLE - self.t)

    def events(self, *operations):
        """Return the distinct events that were sent since the last time, of these operations."""
        seen = {}
        for message in self._events:
            seen.setdefault((message.sequence, message.operation), message)
        self._events.clear()
        found = [Event(m.operation, m.axis, *struct.unpack("<IiB", m.payload)) for m in seen.values()]
        for message in seen.values():
            acknowledgement = encode_frame(
                self.number, Kind.ACKNOWLEDGEMENT, message.sequence, message.operation, 0, b""
            )
            self.device.receive(acknowledgement, self.t)
        return [event for event in found if not operations or event.operation in operations]

    # What tests do all the time

    def snapshot(self, axis=0):
        reply = self.ok(0x14)
        return Axis(*struct.unpack_from("<iiBBBB", reply, 4 + 12 * axis))

    def inputs(self, axis=0):
        return self.ok(0x1C, axis=axis)[0]

    def read(self, register, count=1, axis=0):
        return self.ok(0x10, [register, count], axis)

    def write(self, register, *values, axis=0):
        """Return the status of a WRITE."""
        return self.status(0x11, [register, *values], axis)

    def filter(self, axis=0, filter_bytes=EYE_FILTER):
        self.ok(FILTER, filter_bytes, axis)

    def enter(self, mode, axis=0, filter_bytes=EYE_FILTER, acceleration=256, maximum=100):
        """Write filter and profile and enter a mode, a few samples after power-up."""
        self.filter(axis, filter_bytes)
        self.profile(acceleration, maximum, axis)
        self.run_samples(2)
        self.ok(MODE, [mode], axis)

    def profile(self, acceleration, maximum, axis=0):
        self.ok(PROFILE, struct.pack("<HB", acceleration, maximum), axis)

    def command(self, position, axis=0):
        return self.status(0x13, struct.pack("<i", position), axis)

    def velocity(self, value, axis=0):
        return self.status(0x17, struct.pack("<h", value), axis)

    def move(self, final, start=1, axis=0):
        return self.status(0x19, struct.pack("<iB", final, start), axis)

    def settings(self, axis=0):
        return Settings(*struct.unpack("<BHBB", self.ok(0x22, axis=axis)))

    def watchdog(self, timeout_ms, action=0):
        return self.status(0x04, struct.pack("<HB", timeout_ms, action), WHOLE)

    def inject(self, verb, **arguments):
        self.machine.advance_to(self.t)
        self.machine.verbs[verb](**arguments)

    def close(self, side="positive", held="closed", axis="left_vergence"):
        self.inject("switch", axis=axis, side=side, held=held)

    def drives(self):
        """Everything that could move an axis in idle, by its status."""
        return {
            "MODE": {self.status(0x16, [mode]) for mode in (1, 2, 3)},
            "COMMAND": {self.command(1)},
            "VELOCITY": {self.velocity(1)},
            "MOVE": {self.move(1, start=0), self.move(1, start=1)},
            "START": {self.status(0x1A, [1], WHOLE)},
            "08H": {self.write(0x08, 0x90)},
            "09H": {self.write(0x09, 1)},
            "0CH": {self.write(0x0C, 0, 0, 1)},
            "23H": {self.write(0x23, 1)},
            "3CH": {self.write(0x3C, 1)},
            "00H": {self.write(0x00, 0x08)},
            "05H": {self.write(0x05, 3)},
        }

    def never_refused(self):
        """MODE 0, STOP, reads, settings: their statuses."""
        return {
            self.status(0x16, [0]),
            self.status(0x20),
            self.status(0x10, [0x12, 3]),
            self.status(0x12),
            self.status(0x14, axis=WHOLE),
            self.status(0x15, (225, 0, 5, 255)),
            self.status(0x18, [0, 1, 10]),
            self.status(0x1B, bytes(4)),
            self.status(0x1C),
            self.status(0x1D, [0]),
            self.status(0x1F, [0, 0]),
            self.status(0x21),
            self.status(0x22),
            self.write(0x08, 0x80, 0),
            self.write(0x20, 225, 0, 5),
            self.write(0x29, 1, 2, 3),
            self.write(0x05, 1),
            self.write(0x18, 1, 2, 3, 4),
        }

    def joint(self, axis=0):
        self.machine.advance_to(self.t)
        return self.machine.joints[NAMES[self.number, axis]]


@pytest.fixture
def rig():
    return Rig()


@pytest.fixture
def make_rig():
    return Rig
