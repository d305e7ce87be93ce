"""A host's hand on the amplifiers' line: bytes in, bytes out, at chosen times, no wire between."""

import struct

import pytest

from sim_devices.head import HeadConfig, HeadMachine
from sim_devices.servo_amp.frame import crc16

READ, WRITE = 1, 2
NAMES = {1: "left_vergence", 2: "right_vergence", 3: "tilt", 4: "pan"}


class Line:
    """A host's hand on the amplifiers' line; `drive` writes the board's open-loop output."""

    def __init__(self, **config):
        config.setdefault("start_deg", dict.fromkeys(NAMES.values(), 0.0))
        self.machine = HeadMachine(HeadConfig(**config), seed=0)
        self.machine.power_up(0.0)
        self.device = self.machine.amplifier_line
        self.device.send = lambda data, t: self.sent.append(data)
        self.sent = []
        self.t = 0.0

    def send(self, address, kind, index, offset, words, data=b"", sequence=0):
        header = bytes([0xA5, address, sequence << 2 | kind, index, offset, words])
        frame = header + crc16(header).to_bytes(2, "big")
        if data:
            frame += data + crc16(data).to_bytes(2, "big")
        self.device.receive(frame, self.t)
        return self.sent.pop() if self.sent else None

    def status(self, *args, **kwargs):
        return self.send(*args, **kwargs)[3]

    def read(self, index, offset, words=1, address=1):
        reply = self.send(address, READ, index, offset, words)
        assert reply[3] == 1
        return reply[8:-2]

    def word(self, index, offset, address=1):
        return struct.unpack("<H", self.read(index, offset, 1, address))[0]

    def signed(self, index, offset, words=1, address=1):
        return int.from_bytes(self.read(index, offset, words, address), "little", signed=True)

    def write(self, index, offset, value, words=1, address=1):
        return self.status(address, WRITE, index, offset, words, value.to_bytes(2 * words, "little"))

    def enable(self, *addresses):
        for address in addresses or NAMES:
            assert self.write(7, 0, 0x000F, address=address) == 1
            assert self.write(1, 0, 0, address=address) == 1

    def run(self, seconds):
        end = self.t + seconds
        while (due := self.device.next_due()) is not None and due <= end:
            self.t = max(due, self.t)
            self.device.advance_to(self.t)
        self.t = end
        self.machine.advance_to(end)

    def drive(self, name, command):
        self.machine.advance_to(self.t)
        self.machine.joints[name].drive(command)
        channel = self.machine.channels[name]
        channel.chip.motor_command = command

    def inject(self, verb, **arguments):
        self.machine.advance_to(self.t)
        self.machine.verbs[verb](**arguments)

    def board_sees_fault(self, name="left_vergence"):
        return bool(self.machine.channels[name].inputs & 0x08)


@pytest.fixture
def line():
    return Line()


@pytest.fixture
def make_line():
    return Line


@pytest.fixture
def enabled():
    line = Line()
    line.enable()
    return line
