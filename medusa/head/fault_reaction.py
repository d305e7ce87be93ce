"""One joint's fault stops all: whatever a drive reports, the other joints come to rest, too, and that is confirmed."""

import asyncio
import logging
from collections.abc import Callable

from medusa.errors import MedusaError
from medusa.head.drive import Drive
from medusa.head.faults import Cause, Fault
from medusa.head.stopping import Stopping

log = logging.getLogger(__name__)


class FaultReaction:
    """Listens to a drive; any fault but a joint held at its soft limit stops the other joints.

    `before_stop` is called when such a stop is on its way.
    """

    def __init__(self, drive: Drive, stopping: Stopping, before_stop: Callable[[], None]) -> None:
        self._drive = drive
        self._stopping = stopping
        self._before_stop = before_stop
        self._stop: asyncio.Task[str] | None = None
        self.emergency = False
        """An emergency stop is in force, or on its way: another report of it asks for no other."""
        self._leave = drive.subscribe(self._react)

    def close(self) -> None:
        """Listen no longer."""
        self._leave()

    async def stopped(self) -> str:
        """Wait until the stop that a fault caused is confirmed; what else there is to report of it."""
        return await asyncio.shield(self._stop) if self._stop is not None else ""

    def _react(self, fault: Fault) -> None:
        if not fault.stops_all:
            return
        emergency = fault.cause is Cause.EMERGENCY_STOP
        if emergency and self.emergency:
            return
        self.emergency |= emergency
        if self._stop is None or self._stop.done() or emergency:
            before = self._stop
            self._before_stop()
            self._stop = asyncio.get_running_loop().create_task(
                self._stop_all(fault, before), name="stop for a fault"
            )

    async def _stop_all(self, fault: Fault, before: "asyncio.Task[str] | None") -> str:
        try:
            if fault.cause is Cause.EMERGENCY_STOP:
                # One emergency stop anywhere is one everywhere: another device may not have received it.
                await self._stopping.emergency_stop()
            else:
                await self._stopping.stop()
            return await self._drive.after_stop(fault)
        except MedusaError as error:
            log.error("%s", error)
            return str(error)
        finally:
            if before is not None and not before.done():
                before.cancel()
