"""Keeping the watchdogs of boards and amplifiers fed, and reading what the amplifiers report."""

import asyncio
import logging
from collections.abc import Callable, Mapping

from medusa.errors import MedusaError
from medusa.head.faults import Cause, Fault
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Board, Inputs
from medusa.mc3000.config import SafetyConfig
from medusa.servo_amp import Amplifier

log = logging.getLogger(__name__)

FEEDS_PER_TIMEOUT = 3
"""A watchdog is fed three times a period, so that one lost frame and its repeat do not trip it."""
FEED_SENDINGS = 3
"""Sendings that fit between two feeds: six before the watchdog expires."""
EARLY_SECONDS = 1e-6


class Feeding:
    """Feeds from the moment a joint is enabled until the last is disabled."""

    def __init__(
        self,
        axes: Mapping[str, Axis],
        boards: Mapping[int, Board],
        amplifiers: Mapping[str, Amplifier],
        report: Callable[[Fault], None],
        safety: SafetyConfig,
    ) -> None:
        self._axes = axes
        self._boards = boards
        self._amplifiers = amplifiers
        self._report = report
        self._safety = safety
        self._tasks: list[asyncio.Task[None]] = []

    def start(self) -> None:
        """Begin to feed; the watchdogs have been switched on."""
        if self._tasks:
            return
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(self._feed_board(board), name="feed board") for board in self._boards.values()
        ]
        if self._safety.amplifier_watchdog_ms > 0:
            self._tasks.append(loop.create_task(self._feed_amplifiers(), name="feed amplifiers"))

    async def end(self) -> None:
        """Stop feeding; the watchdogs have been switched off, or are to expire."""
        tasks, self._tasks = self._tasks, []
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _feed_board(self, board: Board) -> None:
        """Every answered request feeds; one is made up only when nothing else was answered for long.

        It is an addressed one, whose reply shows that the host still receives from whom it keeps in motion.
        """
        loop = asyncio.get_running_loop()
        period = self._safety.board_watchdog_ms / 1000 / FEEDS_PER_TIMEOUT
        answered = True
        while True:
            wait = board.received_at + period - loop.time()
            if not board.may_move:
                wait = period
            if wait > EARLY_SECONDS:
                await asyncio.sleep(wait)
                continue
            try:
                await board.feed(period / FEED_SENDINGS)
                answered = True
            except MedusaError as error:
                if answered:
                    log.warning("board %02XH not fed: %s", board.address, error)
                answered = False
                await asyncio.sleep(period)

    async def _feed_amplifiers(self) -> None:
        period = self._safety.amplifier_watchdog_ms / 1000 / FEEDS_PER_TIMEOUT
        reported: set[str] = set()
        while True:
            await asyncio.sleep(period)
            for name, amplifier in self._amplifiers.items():
                try:
                    faults = (await amplifier.status()).faults
                    cause, reason = Cause.DRIVE, f"amplifier fault: {', '.join(faults)}"
                except MedusaError as error:
                    faults = ("no answer",)
                    cause, reason = Cause.LOST, f"amplifier does not answer: {error}"
                if not faults:
                    reported.discard(name)
                elif name not in reported:
                    reported.add(name)
                    if cause is Cause.LOST or not await self._reported_by_board(name):
                        now = asyncio.get_running_loop().time()
                        self._report(Fault(cause, (name,), reason, now))

    async def _reported_by_board(self, name: str) -> bool:
        axis = self._axes[name]
        try:
            return bool(await axis.board.inputs(axis.channel) & Inputs.FAULT_LATCHED)
        except MedusaError:
            return False
