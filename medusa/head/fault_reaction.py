"""Turns what the boards and the link report into faults, and stops the whole head for them."""

import asyncio
import logging
from collections.abc import Callable, Mapping

from medusa.errors import DeviceRestarted, MedusaError
from medusa.head.faults import Fault, FaultHub, FaultKind, fault_from_event
from medusa.head.stopping import Stopping
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Board, BoardEvent
from medusa.mc3000.homing.mark import NO_MARK
from medusa.servo_amp import Amplifier

log = logging.getLogger(__name__)

VOIDS_HOMING = frozenset({FaultKind.LIMIT, FaultKind.FOLLOWING, FaultKind.STALLED})
"""Within the soft limits no joint meets a switch or loses its command, unless its count is wrong."""


class FaultWatch:
    """Listens to every board; any fault but a joint held at its soft limit stops the other joints, too."""

    def __init__(
        self,
        axes: Mapping[str, Axis],
        boards: Mapping[int, Board],
        amplifiers: Mapping[str, Amplifier],
        hub: FaultHub,
        stopping: Stopping,
    ) -> None:
        self._axes = axes
        self._amplifiers = amplifiers
        self._hub = hub
        self._stopping = stopping
        self._stop: asyncio.Task[str] | None = None
        self.emergency = False
        self._leave: list[Callable[[], None]] = [hub.subscribe(self._react)]
        for board in boards.values():
            self._watch(board)

    def close(self) -> None:
        """Listen no longer."""
        for leave in self._leave:
            leave()
        self._leave.clear()

    async def stopped(self) -> str:
        """Wait until the stop that a fault caused is confirmed; what else there is to tell of it."""
        return await asyncio.shield(self._stop) if self._stop is not None else ""

    def _watch(self, board: Board) -> None:
        names = self._stopping.names_on(board.address)

        def on_event(event: BoardEvent) -> None:
            concerned = tuple(n for n in names if event.axis in (None, self._axes[n].channel))
            now = asyncio.get_running_loop().time()
            fault = fault_from_event(event, concerned, board.clock.to_loop(event.time_us) or now)
            if fault is not None:
                self._hub.publish(fault)

        def on_lost(error: MedusaError) -> None:
            restarted = isinstance(error, DeviceRestarted)
            kind = FaultKind.RESTARTED if restarted else FaultKind.LOST
            for name in names:
                self._axes[name].note_lost()
                # Whether the count still holds is read from the mark when the board is opened again.
                self._axes[name].homed = False
            reason = f"{kind.value}: {error}"
            self._hub.publish(Fault(kind, names, reason, asyncio.get_running_loop().time()))

        def on_restart(error: MedusaError) -> None:
            for name in names:
                self._axes[name].homed = False
            log.warning("%s", error)

        self._leave += [
            board.subscribe(on_event),
            board.session.on_lost(on_lost),
            board.session.on_restart(on_restart),
        ]

    def _react(self, fault: Fault) -> None:
        if not fault.stops_head:
            return
        if fault.kind in VOIDS_HOMING:
            for name in fault.axes:
                self._axes[name].homed = False
        emergency = fault.kind is FaultKind.EMERGENCY_STOP
        if emergency and self.emergency:
            return
        self.emergency |= emergency
        if self._stop is None or self._stop.done() or emergency:
            before = self._stop
            self._stop = asyncio.get_running_loop().create_task(
                self._stop_head(fault, before), name="stop for a fault"
            )

    async def _stop_head(self, fault: Fault, before: "asyncio.Task[str] | None") -> str:
        try:
            if fault.kind is FaultKind.EMERGENCY_STOP:
                # One emergency stop anywhere is one everywhere: the other board may not have heard it.
                await self._stopping.emergency_stop()
            else:
                await self._stopping.stop()
            if fault.kind in VOIDS_HOMING:
                for axis in (self._axes[name] for name in fault.axes):
                    await axis.board.write_mark(axis.channel, NO_MARK)
        except MedusaError as error:
            log.error("%s", error)
            return str(error)
        finally:
            if before is not None and not before.done():
                before.cancel()
        return await self._amplifier_told(fault) if fault.kind is FaultKind.AMPLIFIER else ""

    async def _amplifier_told(self, fault: Fault) -> str:
        told: list[str] = []
        for name in fault.axes:
            try:
                told += (await self._amplifiers[name].status()).faults
            except MedusaError as error:
                told.append(str(error))
        return f"the amplifier says {', '.join(told)}" if told else ""
