"""The base's operations on the wire: numbers, modes, flags, details, payloads (docs/protocols)."""

from enum import IntEnum, IntFlag
from math import pi

POSE, SET_POSE, DRIVE, GO, TURN, STOP, LIMITS, STATUS, ENCODERS = range(0x30, 0x39)
PAYLOADS = {
    POSE: "",
    SET_POSE: "<3i",
    DRIVE: "<hhH",
    GO: "<i",
    TURN: "<i",
    STOP: "",
    LIMITS: "<4H",
    STATUS: "",
    ENCODERS: "",
}

EVENT_EMERGENCY_STOP, EVENT_WATCHDOG = 0x43, 0x44
EVENT_DONE, EVENT_BUMPER, EVENT_BATTERY_LOW, EVENT_STALLED = range(0x50, 0x54)

UNKNOWN, BAD_AXIS, BAD_LENGTH, OUT_OF_RANGE = 1, 2, 3, 4
WRONG_MODE, LATCHED, EMERGENCY_LATCHED, BUSY = 6, 8, 9, 11

COUNTS_PER_METRE = 50000
LENGTH_UNIT = 1e-4
ANGLE_UNIT = 0.01 * pi / 180
TURN_ACCELERATION_UNIT = 0.1 * pi / 180
ACCELERATION_UNIT = 1e-3
MAX_SPEED_UNITS = 10000
MAX_TURN_RATE_UNITS = 32767
VALID_MS = range(1, 2001)


class Mode(IntEnum):
    """What the base is doing."""

    IDLE = 0
    DRIVE = 1
    GO = 2
    TURN = 3
    STOPPING = 4


class Flag(IntFlag):
    """Bits of STATUS."""

    MOVING = 1
    FRONT = 2
    REAR = 4
    LEFT = 8
    RIGHT = 16
    EMERGENCY_STOP = 32
    MOTOR_POWER = 64
    BATTERY_LOW = 128
    STALLED = 256


class Outcome(IntEnum):
    """Detail of event 50: what ended a GO or TURN."""

    REACHED = 0
    STOP = 1
    BUMPER = 2
    EMERGENCY_STOP = 3
    WATCHDOG = 4
    STALLED = 5


def wrap_i32(value: float) -> int:
    """Round to a whole number of units, as 32 bits hold it."""
    return (round(value) + 0x80000000 & 0xFFFFFFFF) - 0x80000000


def clip_i16(value: float) -> int:
    """Round to a whole number of units; what 16 bits cannot hold stands at their end."""
    return max(-0x8000, min(0x7FFF, round(value)))
