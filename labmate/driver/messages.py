"""The base's operations and events as typed messages (docs/protocols: the Labmate base); SI units and radians.

Each message knows its payload both ways: `encode` rounds to the wire's unit and refuses what the field cannot
hold, `decode` refuses a payload of the wrong length. No I/O, no clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from math import radians
from typing import ClassVar, Final, Self

from medusa.errors import ProtocolError
from medusa.link.layout import Field, Layout
from medusa.link.operation import Operation

DEVICE_TYPE: Final = 2
DEFAULT_ADDRESS: Final = 0x10

EVENT_EMERGENCY_STOP: Final = 0x43
EVENT_WATCHDOG: Final = 0x44
EVENT_MOTION_DONE: Final = 0x50
EVENT_BUMPER: Final = 0x51
EVENT_BATTERY_LOW: Final = 0x52
EVENT_STALLED: Final = 0x53

_EVENTS: Final = (
    *(EVENT_EMERGENCY_STOP, EVENT_WATCHDOG),
    *(EVENT_MOTION_DONE, EVENT_BUMPER, EVENT_BATTERY_LOW, EVENT_STALLED),
)
EVENT_MASK: Final = sum(1 << (event - 0x40) for event in _EVENTS)
"""Every event of the base, as EVENT_MASK takes them (bit n: event 40H + n)."""

EVENT_NAMES: Final = {
    EVENT_EMERGENCY_STOP: "event EMERGENCY_STOP",
    EVENT_WATCHDOG: "event WATCHDOG",
    EVENT_MOTION_DONE: "event MOTION_DONE",
    EVENT_BUMPER: "event BUMPER",
    EVENT_BATTERY_LOW: "event BATTERY_LOW",
    EVENT_STALLED: "event STALLED",
}

TENTH_MM: Final = 1e-4
CENTIDEGREE: Final = radians(0.01)
MILLI: Final = 1e-3
DECIDEGREE: Final = radians(0.1)


class Mode(IntEnum):
    """What the base is doing."""

    IDLE = 0
    DRIVE = 1
    GO = 2
    TURN = 3
    STOPPING = 4


class Flags(IntFlag):
    """The flags of STATUS."""

    MOVING = 1 << 0
    FRONT_BUMPER = 1 << 1
    REAR_BUMPER = 1 << 2
    LEFT_BUMPER = 1 << 3
    RIGHT_BUMPER = 1 << 4
    EMERGENCY_STOP = 1 << 5
    MOTOR_POWER = 1 << 6
    BATTERY_LOW = 1 << 7
    STALLED = 1 << 8


class Bumper(IntFlag):
    """Detail of event 51."""

    FRONT = 1
    REAR = 2
    LEFT = 4
    RIGHT = 8


class Ending(IntEnum):
    """Detail of event 50: what ended a GO or a TURN."""

    REACHED = 0
    STOP = 1
    BUMPER = 2
    EMERGENCY_STOP = 3
    WATCHDOG = 4
    STALLED = 5


class Message:
    """A payload with a layout."""

    __slots__ = ()
    LAYOUT: ClassVar[Layout]

    def encode(self) -> bytes:
        """The payload; raises CommandError when a value does not fit its field."""
        return self.LAYOUT.pack(*(getattr(self, field.name) for field in self.LAYOUT.fields))

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """The message of a payload; raises ProtocolError on another length."""
        return cls(*cls.LAYOUT.unpack(payload))


@dataclass(frozen=True, slots=True)
class HelloPart(Message):
    """HELLO's own part: nominal wheel base, m, and encoder counts per metre."""

    wheel_base: float
    counts_per_metre: int
    LAYOUT = Layout("HELLO's own part", Field("wheel_base", "H", TENTH_MM), Field("counts_per_metre", "I"))


@dataclass(frozen=True, slots=True)
class PoseReply(Message):
    """The base's own reckoning at `time_us` (since power-up, wraps): m, rad, m/s, rad/s."""

    time_us: int
    x: float
    y: float
    heading: float
    speed: float
    turn_rate: float
    LAYOUT = Layout(
        "POSE",
        Field("time_us", "I"),
        Field("x", "i", TENTH_MM),
        Field("y", "i", TENTH_MM),
        Field("heading", "i", CENTIDEGREE),
        Field("speed", "h", TENTH_MM),
        Field("turn_rate", "h", CENTIDEGREE),
    )


@dataclass(frozen=True, slots=True)
class SetPose(Message):
    """The pose that the base shall take its own for: m, rad."""

    x: float
    y: float
    heading: float
    LAYOUT = Layout(
        "SET_POSE", Field("x", "i", TENTH_MM), Field("y", "i", TENTH_MM), Field("heading", "i", CENTIDEGREE)
    )


@dataclass(frozen=True, slots=True)
class Drive(Message):
    """Speed (m/s) and turn rate (rad/s), valid for some time (s, 0.001–2)."""

    speed: float
    turn_rate: float
    valid: float
    LAYOUT = Layout(
        "DRIVE",
        Field("speed", "h", TENTH_MM),
        Field("turn_rate", "h", CENTIDEGREE),
        Field("valid", "H", MILLI),
    )


@dataclass(frozen=True, slots=True)
class Go(Message):
    """Distance, m, backwards when negative."""

    distance: float
    LAYOUT = Layout("GO", Field("distance", "i", TENTH_MM))


@dataclass(frozen=True, slots=True)
class Turn(Message):
    """Angle, rad, positive left."""

    angle: float
    LAYOUT = Layout("TURN", Field("angle", "i", CENTIDEGREE))


@dataclass(frozen=True, slots=True)
class SetLimits(Message):
    """Greatest speed (m/s), turn rate (rad/s), acceleration (m/s²) and turn acceleration (rad/s²)."""

    speed: float
    turn_rate: float
    acceleration: float
    turn_acceleration: float
    LAYOUT = Layout(
        "LIMITS",
        Field("speed", "H", TENTH_MM),
        Field("turn_rate", "H", CENTIDEGREE),
        Field("acceleration", "H", MILLI),
        Field("turn_acceleration", "H", DECIDEGREE),
    )


POWER_UP_LIMITS: Final = SetLimits(0.3, radians(15.0), 0.25, radians(30.0))
"""What a base goes by until LIMITS is sent."""


@dataclass(frozen=True, slots=True)
class StatusReply(Message):
    """Mode, flags and battery voltage (V)."""

    mode: Mode
    flags: Flags
    battery: float
    LAYOUT = Layout("STATUS", Field("mode", "B"), Field("flags", "H"), Field("battery", "H", MILLI))

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        mode, flags, battery = cls.LAYOUT.unpack(payload)
        if mode not in Mode.__members__.values():
            raise ProtocolError(f"STATUS reports mode {mode}, known are 0–4", frame=payload)
        return cls(Mode(mode), Flags(flags), battery)

    @property
    def at_rest(self) -> bool:
        """Idle, and both wheels at rest."""
        return self.mode is Mode.IDLE and not self.flags & Flags.MOVING


@dataclass(frozen=True, slots=True)
class EncodersReply(Message):
    """Counts of both wheels at one instant."""

    time_us: int
    left: int
    right: int
    LAYOUT = Layout("ENCODERS", Field("time_us", "I"), Field("left", "i"), Field("right", "i"))


@dataclass(frozen=True, slots=True)
class BaseEvent(Message):
    """An event: when, where the base believed it was, and its detail."""

    time_us: int
    x: float
    y: float
    heading: float
    detail: int
    LAYOUT = Layout(
        "event",
        Field("time_us", "I"),
        Field("x", "i", TENTH_MM),
        Field("y", "i", TENTH_MM),
        Field("heading", "i", CENTIDEGREE),
        Field("detail", "B"),
    )


EVENT_SIZE: Final = BaseEvent.LAYOUT.size
"""Payload bytes of every event."""

POSE: Final = Operation(0x30, "POSE", reply=PoseReply.LAYOUT, reads=True)
SET_POSE: Final = Operation(0x31, "SET_POSE", SetPose.LAYOUT)
DRIVE: Final = Operation(0x32, "DRIVE", Drive.LAYOUT, moves=True)
GO: Final = Operation(0x33, "GO", Go.LAYOUT, moves=True)
TURN: Final = Operation(0x34, "TURN", Turn.LAYOUT, moves=True)
STOP: Final = Operation(0x35, "STOP", stops=True, urgent=True)
LIMITS: Final = Operation(0x36, "LIMITS", SetLimits.LAYOUT)
STATUS: Final = Operation(0x37, "STATUS", reply=StatusReply.LAYOUT, reads=True)
ENCODERS: Final = Operation(0x38, "ENCODERS", reply=EncodersReply.LAYOUT, reads=True)

OPERATIONS: Final = (POSE, SET_POSE, DRIVE, GO, TURN, STOP, LIMITS, STATUS, ENCODERS)
"""What the base can be asked for beyond what every device can."""
