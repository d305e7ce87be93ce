"""Feeding a machine's watchdog while nothing else does."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

from medusa.errors import MedusaError

log = logging.getLogger(__name__)

_FEEDS_PER_TIMEOUT = 3


async def keep_fed(
    watchdog: float, unfed: Callable[[], float], ping: Callable[[], Awaitable[object]]
) -> None:
    """Call `ping` whenever nothing else has fed the watchdog (s) for a third of its time, until cancelled.

    `unfed`: for how long it has not been fed, s.
    """
    period = watchdog / _FEEDS_PER_TIMEOUT
    while True:
        rest = period - unfed()
        # A rest below the clock's resolution would be slept for ever.
        if rest > 1e-3:
            await asyncio.sleep(rest)
            continue
        try:
            await ping()
        except MedusaError as error:
            log.debug("keep-alive: %s", error)
            await asyncio.sleep(period)
