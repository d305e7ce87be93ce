"""Stops that count only when the base has been seen to stand."""

from __future__ import annotations

import asyncio
import logging

from labmate.base.checks import BaseSnapshot
from labmate.base.readings import Readings
from labmate.driver import messages as m
from labmate.driver.connection import Connection
from labmate.driver.messages import Flags
from labmate.errors import StopNotConfirmed
from medusa.errors import CommandError, DeviceRestarted, DeviceSilent, MedusaError, NoReply, PortError

_LOG = logging.getLogger(__name__)

_STOP_ATTEMPTS = 3
_CONFIRM_PERIOD = 0.05
_CONFIRM_MARGIN = 1.0
"""Beyond the ramp (s): three sendings of the STATUS that sees the rest, the drive's pole, a look in 50 ms."""


async def stop(connection: Connection, readings: Readings, ramp: float) -> BaseSnapshot:
    """Ramp to a stop, which may take `ramp` s, and confirm it.

    Raises StopNotConfirmed, after sending an emergency stop where the line still takes one.
    """
    try:
        await _send_stop(connection)
        return await _confirm_rest(readings, ramp + _CONFIRM_MARGIN)
    except PortError as error:
        told = "the stop is not confirmed, the line is gone; the base's own watchdog stops it"
        raise StopNotConfirmed(f"{connection.path}: {told}") from error
    except (MedusaError, TimeoutError) as error:
        told = str(error) or "the base still moves"
        try:
            await connection.line.emergency_stop()
            after = "an emergency stop was sent"
        except MedusaError as failed:
            after = f"nor could an emergency stop be sent ({failed}); its watchdog stops it"
        raise StopNotConfirmed(f"{connection.path}: the stop is not confirmed: {told}; {after}") from error


async def emergency_stop(connection: Connection, readings: Readings) -> BaseSnapshot:
    """Stop at once and latch it; raises StopNotConfirmed unless the base stands and says that it is latched."""
    try:
        await connection.line.emergency_stop()
        stopped = await _confirm_rest(readings, _CONFIRM_MARGIN)
    except (MedusaError, TimeoutError) as error:
        told = str(error) or "the base still moves"
        raise StopNotConfirmed(f"{connection.path}: the emergency stop is not confirmed: {told}") from error
    if not stopped.flags & Flags.EMERGENCY_STOP:
        raise StopNotConfirmed(f"{connection.path}: the base stands, but its emergency stop is not latched")
    return stopped


async def _send_stop(connection: Connection) -> None:
    """STOP until it is answered: it may be said as often as needed, unlike a motion.

    A base that knows no session (it restarted) is greeted instead: HELLO ramps it to a stop as well.
    """
    for left in reversed(range(_STOP_ATTEMPTS)):
        try:
            await connection.request(m.STOP)
        except (DeviceRestarted, CommandError):
            await connection.session.open()
            return
        except DeviceSilent:
            raise
        except NoReply as error:
            if not left:
                raise
            _LOG.warning("STOP: %s", error)
        else:
            return


async def _confirm_rest(readings: Readings, seconds: float) -> BaseSnapshot:
    async with asyncio.timeout(seconds):
        while True:
            try:
                snapshot = await readings.snapshot()
                if snapshot.at_rest:
                    return snapshot
            except NoReply as error:
                _LOG.warning("confirming the stop: %s", error)
            await asyncio.sleep(_CONFIRM_PERIOD)
