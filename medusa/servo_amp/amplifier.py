"""The four servo amplifiers on their line."""

from dataclasses import dataclass
from types import TracebackType
from typing import Self

from medusa.link.trace import Trace


@dataclass(frozen=True)
class AmplifierStatus:
    """What 02.00–02.04 say: whether the bridge is on, and the names of every flag that is set."""

    enabled: bool
    bridge: frozenset[str]
    protection: frozenset[str]
    system_protection: frozenset[str]
    drive_1: frozenset[str]
    drive_2: frozenset[str]

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the faults that hold the bridge off until events are reset; "was reset" is none."""
        raise NotImplementedError

    @property
    def was_reset(self) -> bool:
        """True from power-up until `reset_events`."""
        raise NotImplementedError


class Amplifier:
    """One amplifier; every method raises PortError, NoReply, ProtocolError or CommandError."""

    address: int
    line: "AmplifierLine"

    async def enable(self) -> AmplifierStatus:
        """Take write access, switch the bridge on and poll until it is; raises DeviceFault naming the faults."""
        raise NotImplementedError

    async def inhibit(self) -> AmplifierStatus:
        """Switch the bridge off and read back that it is."""
        raise NotImplementedError

    async def brake(self, on: bool) -> AmplifierStatus:
        """Set or release the dynamic brake (the bridge is inhibited or enabled as before)."""
        raise NotImplementedError

    async def reset_events(self) -> AmplifierStatus:
        """Release latched faults whose cause is gone; returns what remains."""
        raise NotImplementedError

    async def status(self) -> AmplifierStatus:
        raise NotImplementedError

    async def current(self) -> float:
        """Return the measured current in A."""
        raise NotImplementedError

    async def current_demand(self) -> float:
        """Return the demanded current in A."""
        raise NotImplementedError

    async def velocity_counts_s(self) -> float:
        """Return the measured velocity in counts/s."""
        raise NotImplementedError

    async def position_counts(self) -> int:
        """Return the position in counts since power-up (the board's PRESET does not change it)."""
        raise NotImplementedError

    async def bus_voltage(self) -> float:
        """Return the bus voltage in V."""
        raise NotImplementedError

    async def watchdog(self, timeout_ms: int) -> None:
        """Inhibit the bridge, latched, when no command comes for that long; 0 is off."""
        raise NotImplementedError

    async def name(self) -> str:
        """Return the drive's name and firmware."""
        raise NotImplementedError


class AmplifierLine:
    """One command at a time on the whole line, whichever amplifier it is for."""

    def __init__(
        self,
        path: str,
        *,
        baud: int = 115200,
        trace: Trace | None = None,
        name: str = "amps",
        peak_current: float = 20.0,
    ) -> None:
        raise NotImplementedError

    async def __aenter__(self) -> Self:
        raise NotImplementedError

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        raise NotImplementedError

    async def open(self) -> None:
        """Open the port; raises PortError."""
        raise NotImplementedError

    async def close(self) -> None:
        """Close the port; what is still unanswered raises PortError."""
        raise NotImplementedError

    def amplifier(self, address: int) -> Amplifier:
        """Return the amplifier at this address (01H–3FH)."""
        raise NotImplementedError
