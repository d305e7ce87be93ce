"""The board's operations and events as bytes and back, without I/O (docs/protocols, MC3000).

Each operation is a row of `LAYOUTS`: the fields of its request and of its reply, little-endian. The
operations that every framed device has are rows as well, so that a trace can name everything on the line.
READ, WRITE, SNAPSHOT and the events, whose forms a row cannot hold, have functions of their own.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

from medusa.errors import ProtocolError
from medusa.mc3000.board.registers import Flags, Inputs, LatchSource, Mode, Status

AXES = 3
DEVICE_TYPE = 1


class Operation(IntEnum):
    """Operations and events of the board, by number."""

    HELLO = 0x01
    PING = 0x02
    STATISTICS = 0x03
    WATCHDOG = 0x04
    EMERGENCY_STOP = 0x05
    CLEAR = 0x06
    EVENT_MASK = 0x07
    READ = 0x10
    WRITE = 0x11
    POSITION = 0x12
    COMMAND = 0x13
    SNAPSHOT = 0x14
    FILTER = 0x15
    MODE = 0x16
    VELOCITY = 0x17
    PROFILE = 0x18
    MOVE = 0x19
    START = 0x1A
    PRESET = 0x1B
    INPUTS = 0x1C
    LATCH = 0x1D
    LIMIT_ENABLE = 0x1E
    FOLLOWING = 0x1F
    STOP = 0x20
    LATCHED = 0x21
    SETTINGS = 0x22
    PROFILE_DONE = 0x40
    LIMIT_REACHED = 0x41
    STOP_INPUT = 0x42
    EMERGENCY_STOPPED = 0x43
    WATCHDOG_EXPIRED = 0x44
    LATCH_CAUGHT = 0x46
    FOLLOWING_ERROR = 0x47
    AMPLIFIER_FAULT = 0x48


EVENTS = tuple(operation for operation in Operation if operation >= 0x40)
EVENT_MASK_ALL = sum(1 << (operation - 0x40) for operation in EVENTS)


@dataclass(frozen=True)
class Layout:
    """The fields of a request and of its reply with their struct formats (without the byte order)."""

    request: tuple[tuple[str, str], ...] = ()
    reply: tuple[tuple[str, str], ...] = ()


LAYOUTS: dict[Operation, Layout] = {
    Operation.PING: Layout(reply=(("time_us", "I"),)),
    Operation.STATISTICS: Layout(
        reply=(
            ("frames", "I"),
            ("crc_errors", "H"),
            ("framing_errors", "H"),
            ("repeats_answered", "H"),
            ("events_given_up", "H"),
            ("watchdog_trips", "H"),
        )
    ),
    Operation.HELLO: Layout(
        request=(("nonce", "H"),),
        reply=(
            ("nonce", "H"),
            ("protocol", "B"),
            ("device_type", "B"),
            ("firmware", "H"),
            ("boot_count", "H"),
            ("axes", "B"),
            ("clock_hz", "I"),
        ),
    ),
    Operation.WATCHDOG: Layout(request=(("timeout_ms", "H"), ("action", "B"))),
    Operation.EMERGENCY_STOP: Layout(),
    Operation.CLEAR: Layout(),
    Operation.EVENT_MASK: Layout(request=(("mask", "I"),)),
    Operation.POSITION: Layout(reply=(("actual", "i"),)),
    Operation.COMMAND: Layout(request=(("position", "i"),)),
    Operation.FILTER: Layout(request=(("A", "B"), ("B", "B"), ("K", "B"), ("T", "B"))),
    Operation.MODE: Layout(request=(("mode", "B"),)),
    Operation.VELOCITY: Layout(request=(("velocity", "h"),)),
    Operation.PROFILE: Layout(request=(("acceleration_256", "H"), ("maximum", "B"))),
    Operation.MOVE: Layout(request=(("final", "i"), ("start", "B"))),
    Operation.START: Layout(request=(("mask", "B"),)),
    Operation.PRESET: Layout(request=(("actual", "i"),)),
    Operation.INPUTS: Layout(reply=(("inputs", "B"),)),
    Operation.LATCH: Layout(request=(("source", "B"),)),
    Operation.LIMIT_ENABLE: Layout(request=(("enable", "B"),)),
    Operation.FOLLOWING: Layout(request=(("limit", "H"),)),
    Operation.STOP: Layout(),
    Operation.LATCHED: Layout(reply=(("source", "B"), ("caught", "B"), ("position", "i"), ("time_us", "I"))),
    Operation.SETTINGS: Layout(
        reply=(("mode", "B"), ("following_limit", "H"), ("limit_enable", "B"), ("armed", "B"))
    ),
}

_REQUESTS = {op: struct.Struct("<" + "".join(kind for _, kind in row.request)) for op, row in LAYOUTS.items()}
_REPLIES = {op: struct.Struct("<" + "".join(kind for _, kind in row.reply)) for op, row in LAYOUTS.items()}


def encode_request(operation: Operation, **fields: int) -> bytes:
    """Payload of a request; ValueError names a field that is missing, unknown or does not fit."""
    names = [name for name, _ in LAYOUTS[operation].request]
    if set(names) != set(fields):
        raise ValueError(f"{operation.name} takes {', '.join(names) or 'no field'}, not {', '.join(fields)}")
    try:
        return _REQUESTS[operation].pack(*(fields[name] for name in names))
    except struct.error as error:
        given = ", ".join(f"{name}={fields[name]}" for name in names)
        raise ValueError(f"{operation.name}: {given}: {error}") from None


def decode_request(operation: Operation, payload: bytes) -> dict[str, int]:
    """Fields of a request; raises ProtocolError when the length is wrong."""
    return _decode(operation, payload, LAYOUTS[operation].request, _REQUESTS[operation])


def encode_reply(operation: Operation, **fields: int) -> bytes:
    """Payload of a reply with status 0, as a board would send it."""
    return _REPLIES[operation].pack(*(fields[name] for name, _ in LAYOUTS[operation].reply))


def decode_reply(operation: Operation, payload: bytes) -> dict[str, int]:
    """Fields of a reply with status 0; raises ProtocolError when the length is wrong."""
    return _decode(operation, payload, LAYOUTS[operation].reply, _REPLIES[operation])


def _decode(
    operation: Operation, payload: bytes, fields: tuple[tuple[str, str], ...], form: struct.Struct
) -> dict[str, int]:
    if len(payload) != form.size:
        raise ProtocolError(
            f"{operation.name} carries {form.size} bytes, {len(payload)} received", frame=payload
        )
    return {name: value for (name, _), value in zip(fields, form.unpack(payload), strict=True)}


def decode_board_part(part: bytes) -> tuple[int, int]:
    """(axes, clock in Hz): the board's own part of a HELLO reply."""
    if len(part) != 5:
        raise ProtocolError(f"the board's part of HELLO has 5 bytes, {len(part)} received", frame=part)
    return part[0], int.from_bytes(part[1:], "little")


def encode_read(register: int, count: int) -> bytes:
    """Request payload of READ: `count` registers (1–8) from `register` on."""
    return struct.pack("<BB", register, count)


def decode_read(payload: bytes) -> tuple[int, int]:
    """(register, count) of a READ request."""
    if len(payload) != 2:
        raise ProtocolError(f"READ carries 2 bytes, {len(payload)} received", frame=payload)
    return payload[0], payload[1]


def encode_write(register: int, values: bytes) -> bytes:
    """Request payload of WRITE: 1–8 bytes into ascending registers from `register` on."""
    return bytes([register]) + values


def decode_write(payload: bytes) -> tuple[int, bytes]:
    """(register, values) of a WRITE request."""
    if not 2 <= len(payload) <= 9:
        raise ProtocolError(f"WRITE carries 2 to 9 bytes, {len(payload)} received", frame=payload)
    return payload[0], payload[1:]


@dataclass(frozen=True)
class AxisSnapshot:
    """One axis at the instant of a snapshot; positions in counts, `motor_command` −128..127 DAC counts."""

    actual: int
    command: int
    status: Status
    flags: Flags
    motor_command: int
    inputs: Inputs

    @property
    def mode(self) -> Mode:
        """The control mode that the chip's flags show."""
        if self.flags & Flags.IDLE:
            return Mode.IDLE
        if self.flags & Flags.PROPORTIONAL_VELOCITY:
            return Mode.PROPORTIONAL_VELOCITY
        if self.flags & Flags.INTEGRAL_VELOCITY:
            return Mode.INTEGRAL_VELOCITY
        return Mode.POSITION


@dataclass(frozen=True)
class Snapshot:
    """Every axis of a board at one instant; `time_us` counts since power-up and wraps at 2³²."""

    time_us: int
    axes: tuple[AxisSnapshot, ...]


_SNAPSHOT_AXIS = struct.Struct("<iiBBBB")


def decode_snapshot(payload: bytes) -> Snapshot:
    """A SNAPSHOT reply; raises ProtocolError when the length is not that of three axes."""
    if len(payload) != 4 + AXES * _SNAPSHOT_AXIS.size:
        raise ProtocolError(
            f"SNAPSHOT carries {4 + AXES * _SNAPSHOT_AXIS.size} bytes, {len(payload)} received", frame=payload
        )
    return Snapshot(
        int.from_bytes(payload[:4], "little"),
        tuple(
            AxisSnapshot(actual, command, Status(status), Flags(flags), dac - 128, Inputs(inputs))
            for actual, command, status, flags, dac, inputs in _SNAPSHOT_AXIS.iter_unpack(payload[4:])
        ),
    )


def encode_snapshot(snapshot: Snapshot) -> bytes:
    """The reply payload of a snapshot, as a board would send it."""
    return struct.pack("<I", snapshot.time_us) + b"".join(
        _SNAPSHOT_AXIS.pack(a.actual, a.command, a.status, a.flags, a.motor_command + 128, a.inputs)
        for a in snapshot.axes
    )


@dataclass(frozen=True)
class Latched:
    """What LATCH caught: `source` is still armed (DISARMED: not), position in counts, time of the board."""

    source: LatchSource
    caught: bool
    position: int
    time_us: int


@dataclass(frozen=True)
class Settings:
    """Board settings of one axis."""

    mode: Mode
    following_limit: int
    limit_enable: bool
    armed: bool


E = TypeVar("E", bound=IntEnum)


def known(kind: type[E], value: int) -> E:
    """The member of an enumeration with that value; raises ProtocolError when the page knows none."""
    try:
        return kind(value)
    except ValueError:
        raise ProtocolError(f"no {kind.__name__} {value} is known") from None


@dataclass(frozen=True)
class BoardEvent:
    """Something that happened on an axis (None: the whole board); position in counts, time of the board."""

    operation: Operation
    axis: int | None
    time_us: int
    position: int
    detail: int

    @property
    def inputs(self) -> Inputs:
        """The detail of a limit or amplifier fault."""
        return Inputs(self.detail)


_EVENT = struct.Struct("<IiB")


def decode_event(operation: int, axis: int, payload: bytes) -> BoardEvent:
    """A typed event; raises ProtocolError for an event or a length that the page does not know."""
    if operation not in EVENTS or len(payload) != _EVENT.size:
        raise ProtocolError(f"no event {operation:02X}H with {len(payload)} bytes is known", frame=payload)
    time_us, position, detail = _EVENT.unpack(payload)
    return BoardEvent(Operation(operation), None if axis == 0x0F else axis, time_us, position, detail)


EVENT_SIZE = _EVENT.size
"""Payload bytes of every event."""
REPLY_SIZES: dict[int, int] = {
    **{op: form.size for op, form in _REPLIES.items() if op is not Operation.HELLO},
    Operation.WRITE: 0,
    Operation.SNAPSHOT: 4 + AXES * _SNAPSHOT_AXIS.size,
}
"""Payload bytes of a good reply; READ answers as many as it was asked for."""


def encode_event(event: BoardEvent) -> bytes:
    """The payload of an event, as a board would send it."""
    return _EVENT.pack(event.time_us, event.position, event.detail)
