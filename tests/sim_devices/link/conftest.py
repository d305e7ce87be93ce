"""A framed device with the least possible application, a host's hand on it without a wire, and both ends of a wire."""

import asyncio
import os
import struct

import pytest

from sim_devices.link.device import LinkDevice, Refused
from sim_devices.link.faults import FaultPlan
from sim_devices.link.frame import FrameReceiver, Kind, Message, encode_frame
from sim_devices.link.line import Line

HELLO, PING, STATISTICS, WATCHDOG, EMERGENCY_STOP, CLEAR, EVENT_MASK = range(1, 8)
ADDRESS = 0x21


class Lamp:
    """Operation 10H sets a level (u8, above 100: 4), 11H reads it; both stops put it out; axis 0 or 0FH."""

    device_type = 9
    firmware = 0x0304
    axes = frozenset({0})
    watchdog_actions = frozenset({0, 1})

    def __init__(self) -> None:
        self.level = 0
        self.set = 0
        self.stopped = False
        self.power_up = 0.0
        self.now = 0.0
        self.watched: list[bool] = []
        self.due: float | None = None
        self.emit = lambda operation, axis, payload: None

    def attach(self, power_up: float) -> None:
        self.power_up = self.now = power_up

    def hello_part(self) -> bytes:
        return b"lamp"

    def advance_to(self, t: float) -> None:
        if self.due is not None and self.due <= t:
            self.now = self.due
            self.due = None
            self.emit(0x50, 0, struct.pack("<I", round((self.now - self.power_up) * 1e6)))
        self.now = t

    def next_due(self) -> float | None:
        return self.due

    def execute(self, operation: int, axis: int, payload: bytes) -> bytes:
        if operation == 0x11:
            return bytes((self.level,))
        if operation == 0x12:
            raise ZeroDivisionError("a fault in device code")
        if operation != 0x10:
            raise Refused(1)
        if axis not in (0, 0x0F):
            raise Refused(2)
        if len(payload) != 1:
            raise Refused(3)
        if self.stopped:
            raise Refused(9)
        if payload[0] > 100:
            raise Refused(4)
        self.level = payload[0]
        self.set += 1
        return b""

    def new_session(self) -> None:
        self.level = 0

    def emergency_stop(self) -> bool:
        new, self.stopped, self.level = not self.stopped, True, 0
        if new:
            self.emit(0x43, 0x0F, b"")
        return new

    def clear(self, axis: int) -> None:
        if axis not in (0, 0x0F):
            raise Refused(2)
        self.stopped = False

    def watchdog(self, action: int) -> None:
        self.level = 0
        self.emit(0x44, 0x0F, bytes((action,)))

    def watchdog_set(self, on: bool) -> None:
        self.watched.append(on)

    def restart(self, t: float) -> None:
        self.level = 0
        self.stopped = False


class Hand:
    """Gives frames to a device at chosen times and keeps what it sends."""

    def __init__(self) -> None:
        self.lamp = Lamp()
        self.device = LinkDevice(ADDRESS, self.lamp, boot_count=7)
        self.device.send = lambda data, t: self.sent.append((t, data))
        self.sent: list[tuple[float, bytes]] = []
        self.sequence = 0
        self.now = 0.0

    def messages(self) -> list[Message]:
        """Return and forget what was sent."""
        receiver = FrameReceiver()
        messages = [message for _, data in self.sent for message in receiver.feed(data)]
        self.sent.clear()
        assert all(isinstance(message, tuple) for message in messages)
        return messages

    def request(self, operation, payload=b"", *, axis=0x0F, address=ADDRESS, sequence=None, kind=0):
        """Send one frame and return the reply (None when none came); events are left out."""
        if sequence is None:
            self.sequence = (self.sequence + 1) % 64
            sequence = self.sequence
        frame = encode_frame(address, kind, sequence, operation, axis, payload)
        self.device.receive(frame, self.now)
        replies = [message for message in self.messages() if message.kind == Kind.REPLY]
        assert len(replies) <= 1
        return replies[0] if replies else None

    def status(self, *args, **kwargs):
        return self.request(*args, **kwargs).axis

    def hello(self, nonce=b"\x34\x12", mask=0):
        reply = self.request(HELLO, nonce)
        if mask:
            assert self.status(EVENT_MASK, struct.pack("<I", mask)) == 0
        return reply

    def statistics(self):
        names = ("frames", "crc", "framing", "repeats", "given_up", "trips")
        return dict(zip(names, struct.unpack("<I5H", self.request(STATISTICS).payload), strict=True))

    def advance(self, t):
        """Advance as the line would: by way of every time at which the device is due."""
        while (due := self.device.next_due()) is not None and due <= t:
            self.device.advance_to(due)
        self.device.advance_to(t)
        self.now = t


@pytest.fixture
def hand():
    return Hand()


@pytest.fixture
def greeted(hand):
    hand.hello()
    return hand


class Echo:
    """Sends back what it hears, at the instant at which it hears it."""

    def __init__(self) -> None:
        self.heard: list[tuple[float, bytes]] = []
        self.advanced: list[float] = []
        self.dues: list[float] = []
        self.answer = True
        self.breaks = False
        self.send = lambda data, t: None

    def receive(self, data: bytes, t: float) -> None:
        self.heard.append((t, data))
        if self.breaks:
            raise RuntimeError("a fault in device code")
        if self.answer:
            self.send(data, t)

    def advance_to(self, t: float) -> None:
        self.advanced.append(t)
        self.dues = [due for due in self.dues if due > t]

    def next_due(self) -> float | None:
        return min(self.dues, default=None)


class Client:
    """An application's end of the terminal."""

    def __init__(self, path: str) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.got: list[tuple[float, bytes]] = []
        self.loop = asyncio.get_running_loop()
        self.loop.add_reader(self.fd, self._readable)
        self.open = True

    def _readable(self) -> None:
        try:
            data = os.read(self.fd, 4096)
        except OSError:
            data = b""
        if not data:
            self.close()
            return
        self.got.append((self.loop.time(), data))

    def write(self, data: bytes) -> None:
        assert os.write(self.fd, data) == len(data)

    @property
    def bytes(self) -> bytes:
        return b"".join(data for _, data in self.got)

    def close(self) -> None:
        if self.open:
            self.open = False
            self.loop.remove_reader(self.fd)
            os.close(self.fd)


async def run_over_faults(plan: FaultPlan | None, frames: int = 200, gap: float = 0.01):
    """Send numbered frames through a faulty wire; return what arrived, when, and what came back."""
    echo = Echo()
    async with Line([echo], faults=plan) as line:
        client = Client(line.path)
        for n in range(frames):
            client.write(bytes((n,)) * 8)
            await asyncio.sleep(gap)
        await asyncio.sleep(5.0)
        client.close()
    return echo.heard, client.got


@pytest.fixture
def make_echo():
    return Echo


@pytest.fixture
def connect():
    return Client


@pytest.fixture(name="run_over_faults")
def run_over_faults_fixture():
    return run_over_faults
