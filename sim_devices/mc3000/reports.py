"""What an axis of the board tells: its events, and recordings of every sample."""

from dataclasses import dataclass, field
from typing import NamedTuple

PROFILE_DONE, LIMIT, STOP_INPUT, EMERGENCY_STOP, WATCHDOG = range(0x40, 0x45)
LATCH, FOLLOWING_ERROR, AMPLIFIER_FAULT = range(0x46, 0x49)
IDLE, POSITION, PROPORTIONAL_VELOCITY, INTEGRAL_VELOCITY = range(4)
NO_LATCH, HOME_RISING, HOME_FALLING, INDEX = range(4)


class Report(NamedTuple):
    """An event: when in µs since power-up (not wrapped), which, on which axis, position, detail."""

    time_us: int
    operation: int
    axis: int
    position: int
    detail: int


@dataclass
class Recording:
    """Every sample of an axis, taken out of band: s of the event loop, counts, −128..127, true angle in rad."""

    time: list[float] = field(default_factory=list)
    command: list[int] = field(default_factory=list)
    actual: list[int] = field(default_factory=list)
    motor_command: list[int] = field(default_factory=list)
    angle: list[float] = field(default_factory=list)
