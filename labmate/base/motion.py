"""Driving by twists: a command lives as long as the task that gave it, and never long.

Three deadlines lie inside each other. The machine lets a twist run out after `can.expires`. It is renewed three
times as often, but only while the task that opened the motion lives and for `hold` after that task last gave a
twist. Whatever stops the base (bumper, emergency stop, stall, watchdog, a lost line, a restart, STOP) ends the
motion for good: a new one has to be asked for.
"""

from __future__ import annotations

import asyncio
import logging
from types import TracebackType
from typing import Protocol, Self

from labmate.base.checks import check_twist
from labmate.base.driver import Capabilities, Limits
from labmate.base.events import Cause, Event, Stopped
from labmate.base.reading import BaseReading
from labmate.errors import MotionStopped
from medusa.errors import CommandError, MedusaError

log = logging.getLogger(__name__)

_RENEWALS = 3
"""Twists within the validity of one, so that a lost frame and its repeats do not interrupt the motion."""
SHORTEST_HOLD, LONGEST_HOLD = 0.1, 2.0


class Moved(Protocol):
    """What a motion needs of the base that it moves."""

    @property
    def can(self) -> Capabilities: ...

    @property
    def limits(self) -> Limits: ...

    def begin(self, motion: Motion) -> None: ...

    def end(self, motion: Motion) -> None: ...

    async def twist(
        self, speed: float, turn_rate: float, valid: float | None = None, *, motion: Motion | None = None
    ) -> None: ...

    async def stop(self) -> BaseReading: ...


class Motion:
    """`async with base.motion() as motion: motion.twist(speed, turn_rate)`; leaving it stops the base."""

    def __init__(self, base: Moved, hold: float) -> None:
        if not SHORTEST_HOLD <= hold <= LONGEST_HOLD:
            raise CommandError(f"a twist may be held for {SHORTEST_HOLD} to {LONGEST_HOLD:g} s, not {hold} s")
        self._base = base
        self._hold = hold
        self._twist: tuple[float, float] | None = None
        self._given_at = 0.0
        self._changed = asyncio.Event()
        self._failure: MotionStopped | None = None
        self._reported = False
        self._renewing: asyncio.Task[None] | None = None
        self._opened_by: asyncio.Task[object] | None = None

    async def __aenter__(self) -> Self:
        self._opened_by = asyncio.current_task()
        self._base.begin(self)
        self._renewing = asyncio.get_running_loop().create_task(self._renew())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._renewing is not None:
            self._renewing.cancel()
        self._base.end(self)
        try:
            # Carried through, however often we are cancelled.
            await self._base.stop()
        except MedusaError:
            # A lost line is reported by itself; what ended the motion is the better account.
            if self._failure is None and (error is None or isinstance(error, asyncio.CancelledError)):
                raise
            log.warning("the stop after a motion was not confirmed", exc_info=True)
        if self._failure is not None and error is None and not self._reported:
            raise self._failure

    @property
    def failure(self) -> MotionStopped | None:
        """What ended the motion, None while it is ours."""
        return self._failure

    def twist(self, speed: float, turn_rate: float, by: BaseReading | None = None) -> None:
        """Drive at `speed` (m/s) and `turn_rate` (rad/s) from now on, for at most `hold` s.

        `by`: the reading that the command was computed from. Raises StalePose when it is older than 200 ms,
        CommandError over the limits (the last twist then runs out), and what ended the motion.
        """
        if self._failure is not None:
            self._reported = True
            raise self._failure
        now = asyncio.get_running_loop().time()
        try:
            if by is not None:
                by.require_fresh(now)
            expires = self._base.can.expires
            check_twist(self._base.limits, expires, speed, turn_rate, expires)
        except MedusaError:
            self._twist = None
            raise
        self._twist = (speed, turn_rate)
        self._given_at = now
        self._changed.set()

    def take_event(self, event: Event) -> None:
        """Take in what the base reports: whatever stopped it ends the motion."""
        if isinstance(event, Stopped):
            self.fail(event.ending())

    def stop_called(self, error: MotionStopped) -> None:
        """A stop was called from elsewhere."""
        self.fail(error)

    def fail(self, error: MotionStopped) -> None:
        """End the motion: nothing is renewed any more and every later `twist` raises this."""
        if self._failure is None:
            self._failure = error
            self._changed.set()

    async def _renew(self) -> None:
        loop = asyncio.get_running_loop()
        period = self._base.can.expires / _RENEWALS
        while self._failure is None and not (self._opened_by is not None and self._opened_by.done()):
            self._changed.clear()
            if self._twist is not None and loop.time() - self._given_at > self._hold:
                log.warning("no twist for %.2f s: the base runs out", self._hold)
                self._twist = None
            if self._twist is not None:
                try:
                    await self._base.twist(*self._twist, motion=self)
                except MedusaError as error:
                    reason = "refused" if isinstance(error, CommandError) else Cause.LOST.value
                    stopped = MotionStopped(f"the motion ended: {error}", reason=reason)
                    stopped.__cause__ = error
                    self.fail(stopped)
                    return
            try:
                async with asyncio.timeout(period):
                    await self._changed.wait()
            except TimeoutError:
                continue
