"""What an amplifier's status words 02.00–02.04 mean."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass

from medusa.servo_amp.registers import (
    BRIDGE_FLAGS,
    DRIVE_1_FLAGS,
    DRIVE_2_FLAGS,
    PROTECTION_FLAGS,
    SYSTEM_FLAGS,
)


@dataclass(frozen=True)
class AmplifierStatus:
    """Whether the amplifier is enabled, and the names of every flag that is set; an unnamed bit is `bit n`."""

    enabled: bool
    bridge: frozenset[str]
    protection: frozenset[str]
    system_protection: frozenset[str]
    drive_1: frozenset[str]
    drive_2: frozenset[str]

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the faults that inhibit the amplifier until events are reset; "was reset" is none."""
        return tuple(sorted((self.protection - {"was reset"}) | self.system_protection))

    @property
    def was_reset(self) -> bool:
        """True from power-up until `reset_events`."""
        return "was reset" in self.protection

    @property
    def braked(self) -> bool:
        """Whether the dynamic brake holds the motor."""
        return "dynamic brake" in self.bridge


def decode_status(data: bytes) -> AmplifierStatus:
    """The meaning of the five words 02.00–02.04."""
    bridge, protection, system, drive_1, drive_2 = struct.unpack("<5H", data)
    return AmplifierStatus(
        enabled=bool(bridge & 1),
        bridge=_names(bridge, BRIDGE_FLAGS),
        protection=_names(protection, PROTECTION_FLAGS),
        system_protection=_names(system, SYSTEM_FLAGS),
        drive_1=_names(drive_1, DRIVE_1_FLAGS),
        drive_2=_names(drive_2, DRIVE_2_FLAGS),
    )


def _names(word: int, flags: Mapping[int, str]) -> frozenset[str]:
    return frozenset(flags.get(bit, f"bit {bit}") for bit in range(16) if word >> bit & 1)
