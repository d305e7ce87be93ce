"""The board's replies and events as typed values, without I/O (docs/protocols, MC3000)."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final, TypeVar

from medusa.errors import ProtocolError
from medusa.link.layout import Field, Layout
from medusa.link.messages import WHOLE_DEVICE
from medusa.mc3000.board.operations import (
    AXES,
    INPUTS_REPLY,
    LATCHED_REPLY,
    POSITION_REPLY,
    SETTINGS_REPLY,
    SNAPSHOT_REPLY,
)
from medusa.mc3000.board.registers import MOTOR_COMMAND_ZERO, Flags, Inputs, LatchSource, Mode, Status

DEVICE_TYPE: Final = 1


class EventKind(IntEnum):
    """Events of the board, by number."""

    PROFILE_DONE = 0x40
    LIMIT_REACHED = 0x41
    STOP_INPUT = 0x42
    EMERGENCY_STOPPED = 0x43
    WATCHDOG_EXPIRED = 0x44
    LATCH_CAUGHT = 0x46
    FOLLOWING_ERROR = 0x47
    AMPLIFIER_FAULT = 0x48


EVENT_NAMES: Final[dict[int, str]] = {kind: kind.name for kind in EventKind}
EVENT_MASK_ALL: Final = sum(1 << (kind - 0x40) for kind in EventKind)
"""Every event of the board, as EVENT_MASK takes them (bit n: event 40H + n)."""

_HELLO_PART: Final = Layout("the board's part of HELLO", Field("axes", "B"), Field("clock_hz", "I"))
_EVENT: Final = Layout("event", Field("time_us", "I"), Field("position", "i"), Field("detail", "B"))

EVENT_SIZE: Final = _EVENT.size
"""Payload bytes of every event."""


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


@dataclass(frozen=True)
class BoardEvent:
    """Something that happened on an axis (None: the whole board); position in counts, time of the board."""

    kind: EventKind
    axis: int | None
    time_us: int
    position: int
    detail: int

    @property
    def inputs(self) -> Inputs:
        """The detail of a limit or amplifier fault."""
        return Inputs(self.detail)


E = TypeVar("E", bound=IntEnum)


def _known(kind: type[E], value: int) -> E:
    try:
        return kind(value)
    except ValueError:
        raise ProtocolError(f"no {kind.__name__} {value} is known") from None


def decode_board_part(part: bytes) -> tuple[int, int]:
    """(axes, clock in Hz): the board's own part of a HELLO reply."""
    axes, clock_hz = _HELLO_PART.unpack(part)
    return axes, clock_hz


def decode_position(payload: bytes) -> int:
    """The actual position of a POSITION reply, counts."""
    (actual,) = POSITION_REPLY.unpack(payload)
    return int(actual)


def decode_inputs(payload: bytes) -> Inputs:
    """The inputs of an INPUTS reply."""
    return Inputs(*INPUTS_REPLY.unpack(payload))


def decode_snapshot(payload: bytes) -> Snapshot:
    """The content of a SNAPSHOT reply."""
    time_us, *fields = SNAPSHOT_REPLY.unpack(payload)
    size = len(fields) // AXES
    return Snapshot(
        time_us,
        tuple(
            AxisSnapshot(
                actual, command, Status(status), Flags(flags), dac - MOTOR_COMMAND_ZERO, Inputs(inputs)
            )
            for actual, command, status, flags, dac, inputs in (
                fields[axis * size : (axis + 1) * size] for axis in range(AXES)
            )
        ),
    )


def decode_latched(payload: bytes) -> Latched:
    """The content of a LATCHED reply; raises ProtocolError for an unknown source."""
    source, caught, position, time_us = LATCHED_REPLY.unpack(payload)
    return Latched(_known(LatchSource, source), bool(caught), position, time_us)


def decode_settings(payload: bytes) -> Settings:
    """The content of a SETTINGS reply; raises ProtocolError for an unknown mode."""
    mode, following_limit, limit_enable, armed = SETTINGS_REPLY.unpack(payload)
    return Settings(_known(Mode, mode), following_limit, bool(limit_enable), bool(armed))


def decode_event(operation: int, axis: int, payload: bytes) -> BoardEvent:
    """A typed event; raises ProtocolError for one, or a length, that the page does not know."""
    if operation not in EVENT_NAMES:
        raise ProtocolError(f"no event {operation:02X}H is known", frame=payload)
    time_us, position, detail = _EVENT.unpack(payload)
    return BoardEvent(EventKind(operation), None if axis == WHOLE_DEVICE else axis, time_us, position, detail)
