"""A small framed device on an emulated line: a register to set, to read, to add to, and events on demand."""

import struct
from collections.abc import Callable

import pytest

from sim_devices.link.device import Refused

SET, READ, ADD, STOP, RAISE_EVENT, MOVE = 0x30, 0x31, 0x32, 0x33, 0x34, 0x35
BAD_LENGTH, OUT_OF_RANGE = 3, 4


class Toy:
    """Counts what acted: `acts` holds (operation, payload) in the order of acting.

    `sizes` are the payload sizes it insists on, as devices do.
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
