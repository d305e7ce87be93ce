"""GO and TURN by twists, for a base that drives none by itself: the law of the approach, and the loop around it."""

from __future__ import annotations

import asyncio
import logging
from math import copysign, sqrt
from typing import Protocol

from labmate.base.checks import check_travel
from labmate.base.driver import Capabilities, Kind, Limits
from labmate.base.events import UNTOUCHED, Cause
from labmate.base.motion import Motion
from labmate.base.reading import BaseReading
from labmate.base.report import MotionReport, travelled
from labmate.errors import MotionStopped
from medusa.errors import MedusaError, NoReply

_PERIOD = 0.05
_DELAY = _PERIOD + 0.02
"""For how long a speed may hold before the next one acts (s): the period, a reading, a twist under way."""


log = logging.getLogger(__name__)


class Travelling(Protocol):
    """What a travel by twists needs of the base that it drives."""

    @property
    def can(self) -> Capabilities: ...

    @property
    def limits(self) -> Limits: ...

    def motion(self) -> Motion: ...

    async def read(self) -> BaseReading: ...

    async def read_patiently(self) -> BaseReading: ...


def approach_speed(remaining: float, delay: float, limit: float, acceleration: float) -> float:
    """Return the greatest speed from which the base can still stop within what remains (signed; m or rad).

    A speed u that holds for the delay τ and is then ramped down takes |r| = u τ + u²/(2 a), so that
    u = a (√(τ² + 2 |r|/a) − τ), and at most the limit.
    """
    speed = acceleration * (sqrt(delay**2 + 2.0 * abs(remaining) / acceleration) - delay)
    return copysign(min(speed, limit), remaining)


async def travel_by_twists(base: Travelling, kind: Kind, amount: float) -> MotionReport:
    """Drive a GO (m) or TURN (rad) to within half of `can.arrival`, and stop.

    Raises CommandError (did not begin) or MotionStopped (did not arrive, or not in twice the time it takes).
    """
    loop = asyncio.get_running_loop()
    limits, lag = base.limits, base.can.lag
    go = kind == "GO"
    close = 0.5 * base.can.arrival[0 if go else 1]
    patience = 2.0 * (abs(amount) / (limits.speed if go else limits.turn_rate) + limits.stop_seconds + 1.0)
    async with base.motion() as motion:
        start = await base.read_patiently()
        check_travel(kind, start, amount if go else 0.0, 0.0 if go else amount)
        begun, reading = loop.time(), start
        while True:
            remaining = amount - travelled(kind, start.own_pose, reading.own_pose)
            if abs(remaining) <= close:
                break
            if loop.time() - begun > patience:
                # A pose that does not come nearer would drive it on for ever.
                reason = f"{kind}: not arrived after {patience:.1f} s"
                raise MotionStopped(reason, reason=Cause.STALLED.value)
            if go:
                speed = approach_speed(remaining, _DELAY + lag, limits.speed, limits.acceleration)
                motion.twist(speed, 0.0)
            else:
                rate = approach_speed(remaining, _DELAY + lag, limits.turn_rate, limits.turn_acceleration)
                motion.twist(0.0, rate)
            reading = await _read_again(base, motion)
    end = await base.read_patiently()
    return MotionReport(
        kind,
        amount,
        travelled(kind, start.own_pose, end.own_pose),
        Cause.REACHED,
        UNTOUCHED,
        start.own_pose,
        end.own_pose,
        loop.time() - begun,
    )


async def _read_again(base: Travelling, motion: Motion) -> BaseReading:
    """Read a period later; while nothing answers no twist is given, and the last one runs out."""
    while True:
        await asyncio.sleep(_PERIOD)
        try:
            return await base.read()
        except MedusaError as error:
            if motion.failure is not None:
                raise motion.failure from error
            if not isinstance(error, NoReply):
                raise
            log.warning("travelling by twists: %s", error)
