"""Registers, modes, flags and inputs of the board by name (docs/protocols: HCTL-1100 and MC3000)."""

from dataclasses import dataclass
from enum import IntEnum, IntFlag


class Mode(IntEnum):
    """Control modes as the MODE operation numbers them."""

    IDLE = 0
    POSITION = 1
    PROPORTIONAL_VELOCITY = 2
    INTEGRAL_VELOCITY = 3


class Flags(IntFlag):
    """The chip's flags F0–F5 as register 00H reads them."""

    PROFILE = 1
    IDLE = 2
    UNIPOLAR = 4
    PROPORTIONAL_VELOCITY = 8
    HOLD_COMMUTATOR = 16
    INTEGRAL_VELOCITY = 32


class Status(IntFlag):
    """The chip's status register 07H; STOP and LIMIT read 0 when triggered."""

    PWM_INHIBIT = 1
    COMMUTATOR_1 = 2
    COMMUTATOR_2 = 4
    SIGN_REVERSAL = 8
    PROFILE = 16
    IDLE = 32
    STOP_RELEASED = 64
    LIMIT_RELEASED = 128


class Inputs(IntFlag):
    """The board's inputs of one axis; "negative" and "positive" are by counts."""

    NEGATIVE_LIMIT = 1
    POSITIVE_LIMIT = 2
    HOME = 4
    AMPLIFIER_FAULT = 8
    LIMIT_LATCHED = 16
    EMERGENCY_STOP_LATCHED = 32
    FAULT_LATCHED = 64
    WATCHDOG_EXPIRED = 128


class LatchSource(IntEnum):
    """Edges that LATCH can wait for."""

    DISARMED = 0
    HOME_RISING = 1
    HOME_FALLING = 2
    INDEX = 3


class WatchdogAction(IntEnum):
    """What the board does when nobody feeds it."""

    IDLE = 0
    STOP = 1


class Register(IntEnum):
    """Addresses of the chip's registers."""

    FLAGS = 0x00
    PROGRAM_COUNTER = 0x05
    STATUS = 0x07
    MOTOR_COMMAND = 0x08
    PWM_COMMAND = 0x09
    COMMAND_POSITION_MSB = 0x0C
    COMMAND_POSITION_MIDDLE = 0x0D
    COMMAND_POSITION_LSB = 0x0E
    SAMPLE_TIMER = 0x0F
    ACTUAL_POSITION_MSB = 0x12
    ACTUAL_POSITION_MIDDLE = 0x13
    ACTUAL_POSITION_LSB = 0x14
    PRESET_MSB = 0x15
    PRESET_MIDDLE = 0x16
    PRESET_LSB = 0x17
    MARK = 0x18
    FILTER_ZERO = 0x20
    FILTER_POLE = 0x21
    GAIN = 0x22
    PROPORTIONAL_VELOCITY_LSB = 0x23
    PROPORTIONAL_VELOCITY_MSB = 0x24
    ACCELERATION_LSB = 0x26
    ACCELERATION_MSB = 0x27
    MAXIMUM_VELOCITY = 0x28
    FINAL_POSITION_LSB = 0x29
    FINAL_POSITION_MIDDLE = 0x2A
    FINAL_POSITION_MSB = 0x2B
    ACTUAL_VELOCITY_LSB = 0x34
    ACTUAL_VELOCITY_MSB = 0x35
    INTEGRAL_VELOCITY = 0x3C


MARK_LENGTH = 4
"""Registers 18H–1BH keep what a host writes until whatever makes the count invalid clears them."""

MOTOR_COMMAND_ZERO = 0x80
POSITION_MIN, POSITION_MAX = -(2**23), 2**23 - 1

MOVING = frozenset({0x00, 0x05, 0x08, 0x09, 0x0C, 0x0D, 0x0E, 0x23, 0x24, 0x3C})
"""Registers whose writing can move an axis: the link withdraws such a write before a stop."""


@dataclass(frozen=True)
class FilterBytes:
    """D(z) = (K/4)(z − A/256)/(z + B/256) sampled every 16 (T + 1)/f_clk."""

    A: int
    B: int
    K: int
    T: int

    def sample_period(self, clock_hz: int) -> float:
        """Sample period 16 (T + 1)/f_clk, s."""
        return 16 * (self.T + 1) / clock_hz


def encode_position24(counts: int, *, lsb_first: bool = False) -> bytes:
    """Three bytes of a 24-bit two's complement position, most significant first; raises ValueError outside."""
    if not POSITION_MIN <= counts <= POSITION_MAX:
        raise ValueError(f"position {counts} counts is outside {POSITION_MIN}..{POSITION_MAX}")
    return (counts & 0xFFFFFF).to_bytes(3, "little" if lsb_first else "big")


def decode_position24(data: bytes, *, lsb_first: bool = False) -> int:
    """The signed position in three bytes; raises ValueError for another length."""
    if len(data) != 3:
        raise ValueError(f"a 24-bit position has 3 bytes, not {len(data)}")
    return int.from_bytes(data, "little" if lsb_first else "big", signed=False) - (
        0x1000000 if data[2 if lsb_first else 0] & 0x80 else 0
    )
