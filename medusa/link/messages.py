"""The operations that every framed device has (docs/protocols: the serial link), as typed messages."""

import struct
from dataclasses import dataclass, field
from typing import Final

from medusa.errors import ProtocolError

HELLO: Final = 0x01
PING: Final = 0x02
STATISTICS: Final = 0x03
WATCHDOG: Final = 0x04
EMERGENCY_STOP: Final = 0x05
CLEAR: Final = 0x06
EVENT_MASK: Final = 0x07

WHOLE_DEVICE: Final = 0x0F
BROADCAST: Final = 0x00
PROTOCOL_VERSION: Final = 1

OPERATION_NAMES: Final = {
    HELLO: "HELLO",
    PING: "PING",
    STATISTICS: "STATISTICS",
    WATCHDOG: "WATCHDOG",
    EMERGENCY_STOP: "EMERGENCY_STOP",
    CLEAR: "CLEAR",
    EVENT_MASK: "EVENT_MASK",
}

REPLY_SIZES: Final = {PING: 4, STATISTICS: 14, WATCHDOG: 0, EMERGENCY_STOP: 0, CLEAR: 0, EVENT_MASK: 0}

_HELLO = struct.Struct("<HBBHH")
_STATISTICS = struct.Struct("<IHHHHH")


@dataclass(frozen=True)
class Hello:
    """What a device reports of itself when a session opens; `part` is the device's own part."""

    nonce: int
    protocol: int
    device_type: int
    firmware: int
    boot_count: int
    part: bytes = field(default=b"")


@dataclass(frozen=True)
class Statistics:
    """A device's own counters since its power-up; each wraps."""

    frames: int
    crc_errors: int
    framing_errors: int
    repeats_answered: int
    events_given_up: int
    watchdog_trips: int


@dataclass(frozen=True)
class Event:
    """Something that a device reported on its own; the payload is the device's (see its messages)."""

    operation: int
    axis: int
    payload: bytes
    sequence: int


def encode_hello(nonce: int) -> bytes:
    """Return the payload of a HELLO request."""
    return struct.pack("<H", nonce)


def decode_hello(payload: bytes) -> Hello:
    """Return a HELLO reply's content; raises ProtocolError when it is too short or of another protocol."""
    if len(payload) < _HELLO.size:
        raise ProtocolError(
            f"HELLO answered {len(payload)} bytes, at least {_HELLO.size} needed", frame=payload
        )
    nonce, protocol, device_type, firmware, boot_count = _HELLO.unpack_from(payload)
    hello = Hello(nonce, protocol, device_type, firmware, boot_count, payload[_HELLO.size :])
    if hello.protocol != PROTOCOL_VERSION:
        raise ProtocolError(
            f"the device speaks protocol {hello.protocol}, this host {PROTOCOL_VERSION}", frame=payload
        )
    return hello


def decode_ping(payload: bytes) -> int:
    """Return the device's time in µs since power-up (wraps at 2³²)."""
    if len(payload) != 4:
        raise ProtocolError(f"PING answered {len(payload)} bytes, 4 expected", frame=payload)
    return int.from_bytes(payload, "little")


def decode_statistics(payload: bytes) -> Statistics:
    """Return the device's counters."""
    if len(payload) != _STATISTICS.size:
        raise ProtocolError(
            f"STATISTICS answered {len(payload)} bytes, {_STATISTICS.size} expected", frame=payload
        )
    return Statistics(*_STATISTICS.unpack(payload))


def encode_watchdog(timeout_ms: int, action: int) -> bytes:
    """Return the payload of a WATCHDOG request; a timeout of 0 switches it off."""
    return struct.pack("<HB", timeout_ms, action)


def encode_event_mask(mask: int) -> bytes:
    """Return the payload of an EVENT_MASK request; bit n lets event 40H + n through."""
    return struct.pack("<I", mask)
