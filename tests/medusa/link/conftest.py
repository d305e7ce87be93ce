"""A small framed device on an emulated line, and a desk on which an exchange runs by a clock that the test holds."""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from medusa.errors import HostGap, MedusaError
from medusa.link.contact import Contact
from medusa.link.exchange import Exchange, State
from medusa.link.frame import Decoder, Message
from medusa.link.messages import OPERATIONS, Event
from medusa.link.operation import Operation
from medusa.link.request import Request
from sim_devices.link.device import Refused

HELLO = 0x01
SET, READ, ADD, STOP, RAISE_EVENT, MOVE = 0x30, 0x31, 0x32, 0x33, 0x34, 0x35
BAD_LENGTH, OUT_OF_RANGE = 3, 4


class Toy:
    """A register to set, to read and to add to, and events on demand.

    `acts` counts what acted: (operation, payload) in the order of acting; `sizes` are the payload
    sizes it insists on, as devices do.
    """

    device_type = 9
    firmware = 0x0102
    axes = frozenset({0, 1, 2})
    watchdog_actions = frozenset({0})
    emit: Callable[[int, int, bytes], None]

    def __init__(self) -> None:
        self.acts: list[tuple[int, bytes]] = []
        self.value = 0
        self.moving = False
        self.latched = False
        self.sizes: dict[int, int] = {}

    def attach(self, power_up: float) -> None:
        self.power_up = power_up

    def hello_part(self) -> bytes:
        return b"toy"

    def advance_to(self, t: float) -> None:
        pass

    def next_due(self) -> float | None:
        return None

    def execute(self, operation: int, axis: int, payload: bytes) -> bytes:
        if len(payload) != self.sizes.get(operation, len(payload)):
            raise Refused(BAD_LENGTH)
        if operation == READ:
            return struct.pack("<i", self.value) + payload
        if operation == SET and payload[:1] == b"\xff":
            raise Refused(OUT_OF_RANGE)
        self.acts.append((operation, payload))
        if operation == SET:
            self.value = payload[0]
        elif operation == ADD:
            self.value += payload[0]
        elif operation == MOVE:
            if self.latched:
                raise Refused(9)
            self.moving = True
        elif operation == STOP:
            self.moving = False
        elif operation == RAISE_EVENT:
            self.emit(payload[0], axis, payload[1:])
        else:
            raise Refused(1)
        return payload

    def new_session(self) -> None:
        self.moving = False

    def emergency_stop(self) -> bool:
        self.acts.append((0x05, b""))
        self.moving = False
        first, self.latched = not self.latched, True
        return first

    def clear(self, axis: int) -> None:
        self.acts.append((0x06, bytes([axis])))
        self.latched = False

    def watchdog(self, action: int) -> None:
        self.moving = False

    def watchdog_set(self, on: bool) -> None:
        pass

    def restart(self, t: float) -> None:
        self.value = 0
        self.moving = False


@pytest.fixture
def toy() -> Toy:
    return Toy()


@dataclass
class Desk:
    """Runs an exchange: keeps what it sent and how its requests ended."""

    frames: list[bytes] = field(default_factory=list)
    results: dict[Request, bytes | MedusaError] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    losses: list[MedusaError] = field(default_factory=list)
    stuck: set[bytes] = field(default_factory=set)
    gaps: list[HostGap] = field(default_factory=list)
    frames_at_gap: int = 0
    now: float = 0.0
    suspended: float = 0.0

    def __post_init__(self) -> None:
        self.exchange = Exchange(1, self, Contact("device 01H", lambda: self.suspended))

    def send(self, frame: bytes) -> None:
        self.frames.append(frame)

    def dequeue(self, frame: bytes) -> bool:
        if frame in self.stuck:
            self.stuck.remove(frame)
            return True
        return False

    def finish(self, request: Request, result: bytes | MedusaError) -> None:
        assert request not in self.results, "a request ended twice"
        self.results[request] = result

    def deliver(self, event: Event) -> None:
        self.events.append(event)

    def lost(self, error: MedusaError) -> None:
        self.losses.append(error)

    def interrupted(self, gap: HostGap) -> None:
        self.gaps.append(gap)
        self.frames_at_gap = len(self.frames)

    def operation(self, code: int, **does: bool) -> Operation:
        name = {0x19: "MOVE", 0x31: "READ"}.get(code, f"operation {code:02X}H")
        return Operation(code, name, reply=None, **{"urgent": does.get("stops", False), **does})

    @property
    def sent(self) -> list[Message]:
        return [item for item in Decoder().feed(b"".join(self.frames)) if isinstance(item, Message)]

    def ask(
        self, code: int, axis: int = 0x0F, payload: bytes = b"", reply_size: int | None = None, **does: bool
    ) -> Request:
        operation = OPERATIONS.get(code) or self.operation(code, **does)
        request = Request(operation, axis, payload, 0.1, reply_size)
        self.exchange.submit(request, self.now)
        return request

    def answer(self, sequence: int, operation: int, payload: bytes = b"", status: int = 0) -> None:
        self.exchange.receive(Message(1, 1, sequence, operation, status, payload), self.now)

    def answer_last(self, payload: bytes = b"", status: int = 0) -> None:
        self.answer(self.sent[-1].sequence, self.sent[-1].operation, payload, status)

    def let_pass(self, seconds: float) -> None:
        end = self.now + seconds
        while self.exchange.due <= end:
            self.now = self.exchange.due
            self.exchange.expire(self.now)
        self.now = end

    def error(self, request: Request) -> MedusaError:
        result = self.results[request]
        assert isinstance(result, MedusaError)
        return result

    @property
    def sequences(self) -> list[int]:
        """Numbers of what was sent after the first HELLO."""
        return [message.sequence for message in self.sent[1:]]


@pytest.fixture
def new_desk() -> Desk:
    """An exchange without a session."""
    return Desk()


@pytest.fixture
def desk(new_desk: Desk) -> Desk:
    """An exchange in an open session; HELLO took number 0."""
    new_desk.ask(HELLO, payload=b"\x34\x12")
    new_desk.answer(0, HELLO, b"\x34\x12" + b"\x01\x01\x02\x01\x07\x00")
    assert new_desk.exchange.state is State.OPEN
    return new_desk
