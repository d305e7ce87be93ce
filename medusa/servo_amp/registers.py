"""Indexes, offsets, bits and scales of the amplifiers' registers (docs/protocols: servo amplifiers)."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class AmplifierRegister:
    """Where a value is: index, offset and its size in 16-bit words."""

    index: int
    offset: int
    words: int = 1


CONTROL: Final = AmplifierRegister(0x01, 0x00)
STATUS: Final = AmplifierRegister(0x02, 0x00, 5)
WATCHDOG: Final = AmplifierRegister(0x04, 0x01)
WRITE_ACCESS: Final = AmplifierRegister(0x07, 0x00)
NAME: Final = AmplifierRegister(0x0B, 0x00, 128)
BUS_VOLTAGE: Final = AmplifierRegister(0x0F, 0x00)
CURRENT_DEMAND: Final = AmplifierRegister(0x10, 0x02)
CURRENT_MEASURED: Final = AmplifierRegister(0x10, 0x03)
VELOCITY: Final = AmplifierRegister(0x11, 0x02, 2)
POSITION: Final = AmplifierRegister(0x12, 0x00, 2)
PRODUCT: Final = AmplifierRegister(0x8C, 0x00, 176)

INHIBIT: Final = 1 << 0
BRAKE: Final = 1 << 1
RESET_EVENTS: Final = 1 << 12
GRANT_ACCESS: Final = 0x000F

BRIDGE_FLAGS: Final = {
    0: "enabled",
    1: "dynamic brake",
    3: "positive stop",
    4: "negative stop",
    5: "positive torque inhibit",
    6: "negative torque inhibit",
}
PROTECTION_FLAGS: Final = {
    0: "was reset",
    1: "internal error",
    2: "short circuit",
    3: "current overshoot",
    4: "under-voltage",
    5: "over-voltage",
    6: "over-temperature",
}
SYSTEM_FLAGS: Final = {
    4: "motor over-temperature",
    6: "feedback error",
    7: "over-speed",
    10: "communication error",
}
DRIVE_1_FLAGS: Final = {
    1: "commanded inhibit",
    2: "user inhibit",
    3: "positive inhibit",
    4: "negative inhibit",
    5: "current limiting",
    6: "continuous current foldback",
    12: "commanded brake",
}
DRIVE_2_FLAGS: Final = {0: "zero velocity", 1: "at command"}

BUS_VOLTS_PER_UNIT: Final = 0.1
# DS1 = 2¹⁷/20000 units per count/s.
COUNTS_S_PER_UNIT: Final = 20000 / 2**17


def amperes_per_unit(peak_current: float) -> float:
    """1/DC1 = KP/2¹³ for a drive of this peak current in A."""
    return peak_current / 2**13
