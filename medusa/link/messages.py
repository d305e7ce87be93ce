"""The operations that every framed device has (docs/protocols: the serial link), as typed messages."""

from dataclasses import dataclass, field
from typing import Final

from medusa.errors import ProtocolError
from medusa.link.layout import Field, Layout
from medusa.link.operation import Operation

WHOLE_DEVICE: Final = 0x0F
BROADCAST: Final = 0x00
PROTOCOL_VERSION: Final = 1

_HELLO = Layout(
    "HELLO",
    *(Field("nonce", "H"), Field("protocol", "B"), Field("device_type", "B")),
    *(Field("firmware", "H"), Field("boot_count", "H")),
)
_PING = Layout("PING", Field("time_us", "I"))
_STATISTICS = Layout(
    "STATISTICS",
    *(Field("frames", "I"), Field("crc_errors", "H"), Field("framing_errors", "H")),
    *(Field("repeats_answered", "H"), Field("events_given_up", "H"), Field("watchdog_trips", "H")),
)

HELLO: Final = Operation(0x01, "HELLO", Layout("HELLO", Field("nonce", "H")), None, stops=True)
"""Its reply ends with the device's own part, whose size varies."""
PING: Final = Operation(0x02, "PING", reply=_PING, reads=True)
STATISTICS: Final = Operation(0x03, "STATISTICS", reply=_STATISTICS, reads=True)
WATCHDOG: Final = Operation(
    0x04, "WATCHDOG", Layout("WATCHDOG", Field("timeout_ms", "H"), Field("action", "B"))
)
EMERGENCY_STOP: Final = Operation(0x05, "EMERGENCY_STOP", stops=True, urgent=True)
CLEAR: Final = Operation(0x06, "CLEAR", axis="either", stops=True)
EVENT_MASK: Final = Operation(0x07, "EVENT_MASK", Layout("EVENT_MASK", Field("mask", "I")))

OPERATIONS: Final = {
    operation.code: operation
    for operation in (HELLO, PING, STATISTICS, WATCHDOG, EMERGENCY_STOP, CLEAR, EVENT_MASK)
}
"""What every framed device can be asked for, by number."""


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


def decode_hello(payload: bytes) -> Hello:
    """Return a HELLO reply's content; raises ProtocolError when it is too short or of another protocol."""
    if len(payload) < _HELLO.size:
        raise ProtocolError(
            f"HELLO answered {len(payload)} bytes, at least {_HELLO.size} needed", frame=payload
        )
    nonce, protocol, device_type, firmware, boot_count = _HELLO.unpack(payload[: _HELLO.size])
    hello = Hello(nonce, protocol, device_type, firmware, boot_count, payload[_HELLO.size :])
    if hello.protocol != PROTOCOL_VERSION:
        raise ProtocolError(
            f"the device speaks protocol {hello.protocol}, this host {PROTOCOL_VERSION}", frame=payload
        )
    return hello


def decode_ping(payload: bytes) -> int:
    """Return the device's time in µs since power-up (wraps at 2³²)."""
    (time_us,) = _PING.unpack(payload)
    return int(time_us)


def decode_statistics(payload: bytes) -> Statistics:
    """Return the device's counters."""
    return Statistics(*_STATISTICS.unpack(payload))
