"""Stopping, confirmed: whoever stops the head knows that it stands, or which joint might not."""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Collection, Coroutine, Mapping
from typing import Any

from medusa.errors import DeviceFault, MedusaError
from medusa.link import Line
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import AxisSnapshot, Board, Flags, Inputs, Mode
from medusa.mc3000.config import HeadConfig

log = logging.getLogger(__name__)

STANDING_COUNTS = 1
"""A joint at rest in control may flicker by one count (thesis, servo loop: the DAC's limit cycle)."""
READ_BACK_SECONDS = 0.025
"""Between two readings that are compared: a dozen samples of the slowest sample timer."""
MARGIN_SECONDS = 1.5
"""On top of the ramp: the link's repeats, and the coasting of a joint whose bridge a fault switched off."""


Condition = Callable[[AxisSnapshot], bool]


def is_stopped(axis: AxisSnapshot) -> bool:
    """True when nothing commands motion: idle, or position mode without a profile."""
    if axis.mode is Mode.IDLE:
        return True
    return axis.mode is Mode.POSITION and not axis.flags & Flags.PROFILE


def is_emergency_stopped(axis: AxisSnapshot) -> bool:
    """True when idle with a motor command of zero and the emergency stop latched."""
    return (
        axis.mode is Mode.IDLE
        and axis.motor_command == 0
        and bool(axis.inputs & Inputs.EMERGENCY_STOP_LATCHED)
    )


class Stopping:
    """STOP, EMERGENCY_STOP and rest of every joint, each read back with a deadline."""

    def __init__(
        self, axes: Mapping[str, Axis], boards: Mapping[int, Board], line: Line, config: HeadConfig
    ) -> None:
        self._axes = axes
        self._boards = boards
        self._line = line
        self._deadline = config.ramp_seconds + MARGIN_SECONDS
        self._watchdog_ms = config.safety.board_watchdog_ms

    def names_on(self, address: int) -> tuple[str, ...]:
        """Joints that the board at this address drives."""
        return tuple(name for name, axis in self._axes.items() if axis.board.address == address)

    async def stop(self) -> None:
        """STOP every axis by its ramp and confirm that all stand.

        Raises DeviceFault naming the joints whose stop could not be confirmed, after an emergency stop.
        """
        failures = await self._on_every_board(self._stop_board)
        if failures:
            log.error("stop not confirmed (%s): emergency stop", _told(failures))
            with contextlib.suppress(MedusaError):
                # Nobody can be told more than that the stop itself was not confirmed.
                await self._line.emergency_stop()
            raise self._unconfirmed("stop", failures)
        log.info("stopped, confirmed")

    async def _stop_board(self, board: Board) -> None:
        for name in self.names_on(board.address):
            self._axes[name].note_stopping()
        await self._greeted(board)
        await board.stop()
        await self.confirm(board, is_stopped)

    async def _greeted(self, board: Board) -> None:
        """A restarted board is greeted by the line at once, which idles it: wait for that, then look."""
        for _ in range(round(self._deadline / READ_BACK_SECONDS)):
            if not board.awaits_greeting:
                return
            await asyncio.sleep(READ_BACK_SECONDS)

    async def emergency_stop(self) -> None:
        """Stop everything at once by broadcast and to each address, and confirm that all idle and stand.

        Raises DeviceFault naming the joints for which that could not be confirmed.
        """
        try:
            await self._line.emergency_stop()
        except MedusaError as error:
            log.error("emergency stop: %s", error)

        async def confirm(board: Board) -> None:
            await self.confirm(board, is_emergency_stopped)

        failures = await self._on_every_board(confirm)
        if failures:
            raise self._unconfirmed("emergency stop", failures)
        log.info("emergency stop, confirmed")

    async def stand(self, names: Collection[str]) -> None:
        """Wait until these joints are at rest; raises DeviceFault naming those that are not in time."""

        async def confirm(board: Board) -> None:
            await self.confirm(board, is_stopped, names)

        failures = await self._on_every_board(confirm)
        if failures:
            raise self._unconfirmed("rest", failures)

    async def confirm(self, board: Board, condition: Condition, only: Collection[str] | None = None) -> None:
        """Read one board back until its joints satisfy `condition` and stand; DeviceFault in vain."""
        names = [name for name in self.names_on(board.address) if only is None or name in only]
        if not names:
            return
        loop = asyncio.get_running_loop()
        asked = loop.time()
        deadline = asked + self._deadline
        before: dict[str, int] = {}
        while True:
            snapshot, time = await board.timed_snapshot()
            moving = []
            for name in names:
                axis = self._axes[name]
                seen = snapshot.axes[axis.channel]
                axis.note(seen, time)
                at_rest = name in before and abs(seen.actual - before[name]) <= STANDING_COUNTS
                if not (at_rest and condition(seen)):
                    moving.append(name)
                before[name] = seen.actual
            # A repeated reply may show the board as it was before the stop was asked for.
            if not moving and time > asked:
                return
            if loop.time() > deadline:
                raise DeviceFault(
                    f"{', '.join(moving)}: not at rest {self._deadline:.2f} s after the stop",
                    axis=", ".join(moving),
                )
            await asyncio.sleep(READ_BACK_SECONDS)

    async def _on_every_board(
        self, action: Callable[[Board], Coroutine[Any, Any, None]]
    ) -> list[tuple[Board, BaseException]]:
        boards = list(self._boards.values())
        results = await asyncio.gather(*(action(board) for board in boards), return_exceptions=True)
        failures = [(b, r) for b, r in zip(boards, results, strict=True) if isinstance(r, BaseException)]
        for _, failure in failures:
            if not isinstance(failure, MedusaError):
                raise failure
        return failures

    def _unconfirmed(self, what: str, failures: list[tuple[Board, BaseException]]) -> DeviceFault:
        names = [
            str(error.axis)
            if isinstance(error, DeviceFault) and error.axis
            else ", ".join(self.names_on(board.address))
            for board, error in failures
        ]
        return DeviceFault(
            f"{', '.join(names)}: the {what} could not be confirmed ({_told(failures)});"
            f" an unheard board's watchdog acts within {self._watchdog_ms} ms",
            axis=", ".join(names),
        )


def _told(failures: list[tuple[Board, BaseException]]) -> str:
    told: dict[str, list[str]] = {}
    for board, error in failures:
        told.setdefault(str(error), []).append(f"{board.address:02X}H")
    return "; ".join(f"board {', '.join(boards)}: {error}" for error, boards in told.items())
