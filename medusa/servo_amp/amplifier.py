"""One servo amplifier: enabled or inhibited, faults, measurements."""

import asyncio
import struct
from collections.abc import Callable
from typing import Final, Protocol

from medusa.errors import CommandError, DeviceFault, ProtocolError
from medusa.servo_amp.frame import NO_WRITE_ACCESS
from medusa.servo_amp.registers import (
    BRAKE,
    BUS_VOLTAGE,
    BUS_VOLTS_PER_UNIT,
    CONTROL,
    COUNTS_S_PER_UNIT,
    CURRENT_DEMAND,
    CURRENT_MEASURED,
    GRANT_ACCESS,
    INHIBIT,
    NAME,
    POSITION,
    RESET_EVENTS,
    STATUS,
    VELOCITY,
    WATCHDOG,
    WRITE_ACCESS,
    AmplifierRegister,
    amperes_per_unit,
)
from medusa.servo_amp.status import AmplifierStatus, decode_status

_POLL_S: Final = 0.01
_CONFIRM_S: Final = 0.5


class RegisterLine(Protocol):
    """The line that amplifiers hang on, as one of them needs it."""

    peak_current: float

    async def read(self, address: int, register: AmplifierRegister) -> bytes: ...

    async def write(self, address: int, register: AmplifierRegister, data: bytes) -> None: ...


class Amplifier:
    """One amplifier; every method raises PortError, NoReply, ProtocolError or CommandError."""

    def __init__(self, line: RegisterLine, address: int) -> None:
        self.line = line
        self.address = address

    async def enable(self) -> AmplifierStatus:
        """Take write access, enable the amplifier and read back that it is.

        Raises DeviceFault naming what inhibits it.
        """
        await self._write(WRITE_ACCESS, GRANT_ACCESS)
        status = await self.status()
        if status.faults:
            raise DeviceFault(
                f"amplifier {self.address:02X}H: not enabled, latched: {', '.join(status.faults)}",
                axis=self.address,
            )
        await self._write(CONTROL, 0)
        return await self._confirm(lambda now: now.enabled, "is not enabled")

    async def inhibit(self) -> AmplifierStatus:
        """Inhibit the amplifier and read back that it is."""
        await self._write(CONTROL, await self.control() | INHIBIT)
        return await self._confirm(lambda now: not now.enabled, "is not inhibited")

    async def brake(self, on: bool) -> AmplifierStatus:
        """Set or release the dynamic brake; the inhibit stays as it is."""
        control = await self.control()
        await self._write(CONTROL, control | BRAKE if on else control & ~BRAKE)
        return await self._confirm(lambda now: now.braked == on or bool(control & INHIBIT), "did not brake")

    async def reset_events(self) -> AmplifierStatus:
        """Release latched faults whose cause is gone; return what remains.

        An inhibited amplifier stays inhibited, even when only the fault inhibited it, until `enable`.
        """
        control = await self.control()
        if not (await self.status()).enabled:
            control |= INHIBIT
        await self._write(CONTROL, control | RESET_EVENTS)
        await self._write(CONTROL, control & ~RESET_EVENTS)
        return await self.status()

    async def status(self) -> AmplifierStatus:
        """The five status words, read at once."""
        return decode_status(await self.read(STATUS))

    async def control(self) -> int:
        """The control word 01.00."""
        return int.from_bytes(await self.read(CONTROL), "little")

    async def current(self) -> float:
        """The measured current in A."""
        return await self._current(CURRENT_MEASURED)

    async def current_demand(self) -> float:
        """The demanded current in A."""
        return await self._current(CURRENT_DEMAND)

    async def velocity_counts_s(self) -> float:
        """The measured velocity in counts/s."""
        (units,) = struct.unpack("<i", await self.read(VELOCITY))
        return float(units * COUNTS_S_PER_UNIT)

    async def position_counts(self) -> int:
        """The position in counts since power-up (the board's PRESET does not change it)."""
        return int.from_bytes(await self.read(POSITION), "little", signed=True)

    async def bus_voltage(self) -> float:
        """The bus voltage in V."""
        return int.from_bytes(await self.read(BUS_VOLTAGE), "little") * BUS_VOLTS_PER_UNIT

    async def watchdog(self, timeout_ms: int) -> None:
        """Inhibit the amplifier, latched, when no command comes for that long; 0 is off.

        Raises CommandError outside 0–65535 ms.
        """
        if not 0 <= timeout_ms <= 0xFFFF:
            raise CommandError(f"amplifier watchdog of {timeout_ms} ms, allowed 0–65535 ms")
        await self._write(WATCHDOG, timeout_ms)

    async def name(self) -> str:
        """The drive's name and firmware."""
        text = (await self.read(NAME)).replace(b"\0", b" ").decode("ascii", "replace")
        return " ".join(text.split())

    async def read(self, register: AmplifierRegister) -> bytes:
        """A register's words, little-endian."""
        return await self.line.read(self.address, register)

    async def write(self, register: AmplifierRegister, data: bytes) -> None:
        """Write a register; takes write access when the amplifier reports that it is missing."""
        try:
            await self.line.write(self.address, register, data)
        except CommandError as error:
            if error.status != NO_WRITE_ACCESS:
                raise
            await self.line.write(self.address, WRITE_ACCESS, GRANT_ACCESS.to_bytes(2, "little"))
            await self.line.write(self.address, register, data)

    async def _write(self, register: AmplifierRegister, word: int) -> None:
        await self.write(register, word.to_bytes(2, "little"))

    async def _current(self, register: AmplifierRegister) -> float:
        units = int.from_bytes(await self.read(register), "little", signed=True)
        return units * amperes_per_unit(self.line.peak_current)

    async def _confirm(self, reached: Callable[[AmplifierStatus], bool], failure: str) -> AmplifierStatus:
        """Poll 02.00 until it shows what was commanded; raises DeviceFault after half a second."""
        loop = asyncio.get_running_loop()
        end = loop.time() + _CONFIRM_S
        while not reached(status := await self.status()):
            if status.faults or loop.time() >= end:
                why = ", ".join(status.faults or sorted(status.bridge | status.drive_1)) or "no flag set"
                raise DeviceFault(f"amplifier {self.address:02X}H {failure}: {why}", axis=self.address)
            await asyncio.sleep(_POLL_S)
        return status


def expect_words(data: bytes, register: AmplifierRegister, frame: bytes) -> bytes:
    """The data of a read; raises ProtocolError when it is of another size than asked."""
    if len(data) != 2 * register.words:
        raise ProtocolError(f"{len(data) // 2} words answered, {register.words} asked", frame=frame)
    return data
