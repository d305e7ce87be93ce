"""Stops that count only when the base has been read at rest afterwards."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Coroutine
from typing import Any, TypeVar

from labmate.base.driver import BaseDriver
from labmate.base.events import Cause
from labmate.base.reading import BaseReading
from labmate.base.readings import Readings
from labmate.errors import StopNotConfirmed
from medusa.completion import run_to_completion
from medusa.errors import MedusaError, NoReply, PortError

log = logging.getLogger(__name__)

T = TypeVar("T")

_CONFIRM_PERIOD = 0.05
_CONFIRM_MARGIN = 1.0
"""Beyond the ramp (s): three sendings of the reading that sees the rest, the body's lag, a look in 50 ms."""


async def carry_through(stop: Coroutine[Any, Any, T]) -> T:
    """Run a stop to its end, however often its caller is cancelled meanwhile.

    Raises CancelledError then, unless the stop was not confirmed: that has to be known.
    """
    try:
        return await run_to_completion(stop)
    except asyncio.CancelledError as cancelled:
        if isinstance(cancelled.__cause__, StopNotConfirmed):
            raise cancelled.__cause__ from None
        raise


async def with_error(error: BaseException | None, stop: Coroutine[Any, Any, object]) -> None:
    """Run the stop that an error asks for; that it failed goes with the error, and before a cancellation."""
    try:
        await stop
    except MedusaError as failed:
        if error is None or isinstance(error, asyncio.CancelledError):
            raise
        if str(failed) not in getattr(error, "__notes__", ()):
            error.add_note(str(failed))


async def stop(driver: BaseDriver, readings: Readings, ramp: float) -> BaseReading:
    """Ramp to a stop, which may take `ramp` s, and confirm it.

    Raises StopNotConfirmed, after sending an emergency stop where the line still takes one.
    """
    try:
        await driver.stop()
        return await _confirm_rest(readings, ramp + _CONFIRM_MARGIN)
    except PortError as error:
        reason = "the stop is not confirmed, the line is gone; the base's own watchdog stops it"
        raise StopNotConfirmed(f"{driver.name}: {reason}") from error
    except (MedusaError, TimeoutError) as error:
        reason = str(error) or "the base still moves"
        try:
            await driver.emergency_stop()
            after = "an emergency stop was sent"
        except MedusaError as failed:
            after = f"nor could an emergency stop be sent ({failed}); its watchdog stops it"
        raise StopNotConfirmed(f"{driver.name}: the stop is not confirmed: {reason}; {after}") from error


async def emergency_stop(driver: BaseDriver, readings: Readings) -> BaseReading:
    """Stop at once and latch it; raises StopNotConfirmed unless the base is read at rest, the stop latched."""
    try:
        await driver.emergency_stop()
        stopped = await _confirm_rest(readings, _CONFIRM_MARGIN)
    except (MedusaError, TimeoutError) as error:
        reason = str(error) or "the base still moves"
        raise StopNotConfirmed(f"{driver.name}: the emergency stop is not confirmed: {reason}") from error
    if Cause.EMERGENCY_STOP not in stopped.latched:
        raise StopNotConfirmed(f"{driver.name}: the base is at rest, but its emergency stop is not latched")
    return stopped


async def _confirm_rest(readings: Readings, seconds: float) -> BaseReading:
    """Read until the base is at rest; a reading from before the stop confirms nothing."""
    since = asyncio.get_running_loop().time()
    async with asyncio.timeout(seconds):
        while True:
            try:
                reading = await readings.read()
                if reading.at_rest and reading.time >= since:
                    return reading
            except NoReply as error:
                log.warning("confirming the stop: %s", error)
            await asyncio.sleep(_CONFIRM_PERIOD)
